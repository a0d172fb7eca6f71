"""How an episode ends."""

from __future__ import annotations

from enum import IntEnum


class Outcome(IntEnum):
    """What became of an episode, as if it ended now; ``label`` is what a report shows."""

    NEVER_REACHED = 0
    NEVER_TOUCHED = 1
    NEVER_GRASPED = 2
    LOST = 3
    NOT_LIFTED = 4
    FELL_OUT = 5
    LIFTED = 6

    @property
    def label(self) -> str:
        """The outcome in words."""
        return _LABELS[self]

    @property
    def is_success(self) -> bool:
        """Whether an object was lifted."""
        return self is Outcome.LIFTED


_LABELS = {
    Outcome.NEVER_REACHED: "never reached an object",
    Outcome.NEVER_TOUCHED: "reached, never touched",
    Outcome.NEVER_GRASPED: "touched, closed on air or pushed",
    Outcome.LOST: "grasped, then slipped or dropped",
    Outcome.NOT_LIFTED: "held, not lifted in time",
    Outcome.FELL_OUT: "all objects pushed out of the workspace",
    Outcome.LIFTED: "lifted",
}


def outcome_of(stages: tuple[bool, bool, bool, bool], holding: bool, all_out: bool) -> Outcome:
    """Classify an episode.

    Args:
        stages: Whether reach, touch, grasp and lift were completed.
        holding: Whether an object is held now.
        all_out: Whether every object has left the workspace.
    """
    reached, touched, grasped, lifted = stages
    if lifted:
        return Outcome.LIFTED
    if all_out:
        return Outcome.FELL_OUT
    if grasped:
        return Outcome.NOT_LIFTED if holding else Outcome.LOST
    if touched:
        return Outcome.NEVER_GRASPED
    return Outcome.NEVER_TOUCHED if reached else Outcome.NEVER_REACHED
