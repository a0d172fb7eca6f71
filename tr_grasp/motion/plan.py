"""What planning is told and what it gives back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Literal

from tr_grasp.motion.arguments import Array, positive
from tr_grasp.motion.edges import path_length
from tr_grasp.motion.outcome import Outcome

Mode = Literal["auto", "joint", "cartesian", "rrt_connect"]
MODES: tuple[Mode, ...] = ("auto", "joint", "cartesian", "rrt_connect")
How = Literal["joint", "cartesian", "rrt_connect", "reused", "repaired"]
Cancel = Callable[[], bool]


@dataclass(frozen=True)
class PlannerCfg:
    """Settings of :class:`~tr_grasp.motion.planner.Planner`.

    Raises:
        MotionError: A value that is not positive.
    """

    time_limit_s: float = 1.0
    """Give up after so much time of the processor: a crowded machine plans no worse, only later."""

    rounds_n: int | None = None
    """Give up each search after this many rounds too, about 0.13 ms each: what is found no longer depends on the
    machine's speed, as long as the time limit is not what ends it."""

    resolution_rad: float = 0.05
    """Largest motion of a joint between two collision checks; the result is checked again at half of it."""

    range_rad: float = 0.6
    """Longest piece (norm over the joints) by which RRT-Connect grows."""

    shortcuts_n: int = 60
    """Attempts to shorten what RRT-Connect finds."""

    reused_shortcuts_n: int = 6
    """Attempts to shorten a plan that was reused; few, so that plans stay alike."""

    cartesian_step_m: float = 0.01
    """Distance between the poses of a straight tool path."""

    cartesian_turn_rad: float = 0.05
    """Turn between the poses of a straight tool path."""

    jump_rad: float = 0.3
    """A joint that moves further than this between two such poses jumps."""

    cartesian_within_m: float = 0.15
    """In mode ``auto``, a tool goal nearer than this is approached on a straight tool path, as grasps are."""

    postures_n: int = 4
    """Postures of a tool goal that are looked for; a UR5 has up to eight, whatever is said here."""

    seed: int = 1
    """Of the random numbers."""

    def __post_init__(self) -> None:
        for field in fields(self):
            if getattr(self, field.name) is not None:
                positive(f"planner.{field.name}", getattr(self, field.name))


@dataclass(frozen=True, eq=False)
class Plan:
    """A path, or why there is none.

    Attributes:
        outcome: How it ended.
        path: (n, dof) waypoints from the start to the goal [rad]; only where ``outcome.succeeded``.
        how: Which way it was found.
        detail: What exactly was wrong; empty for success.
        seconds: Time it took.
        raw_length_rad: Length before shortcuts.
    """

    outcome: Outcome
    path: Array | None = None
    how: How | None = None
    detail: str = ""
    seconds: float = 0.0
    raw_length_rad: float = 0.0

    @property
    def reason(self) -> str:
        """A sentence for people."""
        return f"{self.outcome.label}{': ' if self.detail else ''}{self.detail}"

    @property
    def length_rad(self) -> float:
        """Length of the path; 0 without one."""
        return 0.0 if self.path is None else path_length(self.path)
