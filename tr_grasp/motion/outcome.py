"""What can come of asking for a motion. The world decides, so these are values and not exceptions."""

from __future__ import annotations

import enum


class Outcome(enum.Enum):
    """How a request ended; ``label`` is for people."""

    OK = "found"
    ALREADY_THERE = "the path has no length: the arm is there already"
    UNREACHABLE = "no joint angles within the limits reach the pose"
    START_OUTSIDE_LIMITS = "the start is outside the joint limits"
    GOAL_OUTSIDE_LIMITS = "the goal is outside the joint limits"
    PATH_OUTSIDE_LIMITS = "the path leaves the joint limits"
    START_IN_COLLISION = "the start is in collision"
    GOAL_IN_COLLISION = "the goal is in collision"
    BLOCKED = "the straight way is blocked"
    JUMP = "the arm would have to jump to another posture on the straight line"
    TIMED_OUT = "no way was found in the time allowed"
    CANCELLED = "it was cancelled"
    INVALIDATED = "the path found did not pass the finer check"
    INFEASIBLE_SPEED = "the limits do not allow the speed asked for at the start or end"

    @property
    def label(self) -> str:
        """A clause for people."""
        return self.value

    @property
    def succeeded(self) -> bool:
        """There is a motion, even if it is one of no length."""
        return self in (Outcome.OK, Outcome.ALREADY_THERE)
