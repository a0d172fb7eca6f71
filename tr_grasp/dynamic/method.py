"""What a way to grasp a moving object is given, and what it gives back: the seam between a method and its trials."""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from tr_grasp.configs.dynamic import ChargesCfg
from tr_grasp.grasps import GraspSet
from tr_grasp.hardware import Station
from tr_grasp.motion import Obstacle
from tr_grasp.objects import ObjectModel
from tr_grasp.robots import RobotSpec

Array = NDArray[np.floating]


class GraspOutcome(enum.Enum):
    """How a trial ended; ``label`` is for people.

    The first group is what a method can say, the second what the judge of a trial finds, whatever the method says.
    """

    LIFTED = "lifted and held"
    NO_GRASP = "no grasp of the set is any good here"
    UNREACHABLE = "the path is out of reach"
    NO_WAY = "no collision-free way was found in time"
    MISSED = "closed on air"
    SLIPPED = "slipped out of the fingers"
    LOST = "the target was out of sight for too long"
    GAVE_UP = "the method gave up"

    OBSTACLE_MOVED = "an obstacle was overturned or pushed away"
    SLAB_TOUCHED = "the slab was touched"
    KNOCKED_OVER = "the target was knocked over or off its carrier"
    PATH_FINISHED = "the path ended before the object was lifted"
    NOT_LIFTED = "the object was not lifted"
    DROPPED = "the object was lifted and not held"

    @property
    def label(self) -> str:
        """A clause for people."""
        return self.value

    @property
    def is_success(self) -> bool:
        """The object was lifted and held."""
        return self is GraspOutcome.LIFTED


class Phase(enum.Enum):
    """What a method is doing, as it tells the trial."""

    REACHING = "on the way to a pre-grasp, or waiting there"
    APPROACHING = "committed: from the pre-grasp to the grasp"
    CLOSING = "fingers are closing"
    LIFTING = "the object is held and goes up"
    HOLDING = "lifted as far as asked"


def _nobody(_: Phase) -> None:
    """Nobody listens."""


@dataclass(frozen=True, eq=False)
class DynamicTask:
    """What is known before a trial, to every method alike; where the target is comes from ``station.world.poses``.

    Attributes:
        robot: The arm and its fingers; its base is the base frame.
        target: Name of the object in ``station.world``.
        model: Its shape; its poses and the grasps are those of this shape's frame (origin: centre of mass).
        grasps: Where to hold it, best first.
        obstacles: What stands around and is not to be touched: the floor, obstacles, the slab. Not the target, nor
            its carrier.
        carrier_size_m: Edges of the box that carries the target.
        T_target_carrier: (4, 4) where the middle of that box is, seen from the target, while the target rides on it.
        path_end_s: When the path ends on the world's clock, and with it the trial; nothing if that is unknown.
        lift_m: How far up the object is to be taken.
        charges: What thinking costs; see :func:`tr_grasp.dynamic.charges.charged`.
        seed: Of whatever is random in a method.
        tell: Call it whenever the phase changes; going back to ``REACHING`` says that another attempt begins.
    """

    robot: RobotSpec
    target: str
    model: ObjectModel
    grasps: GraspSet
    obstacles: tuple[Obstacle, ...]
    carrier_size_m: tuple[float, float, float]
    T_target_carrier: Array
    path_end_s: float | None = None
    lift_m: float = 0.07
    charges: ChargesCfg = field(default_factory=ChargesCfg)
    seed: int = 0
    tell: Callable[[Phase], None] = _nobody


@dataclass(frozen=True, eq=False)
class MethodResult:
    """What a method says about its run; all times are of the world's clock, from the start of the run.

    Attributes:
        outcome: ``LIFTED``, or why not.
        detail: More about it, for people; may be empty.
        committed_s: When it left the pre-grasp for the grasp, in the last attempt; nothing if it never did.
        lifted_s: When the object was up.
        thinking_s: Time charged for thinking.
        attempts, loops, switches: How often it closed the fingers, planned, and changed its mind about the grasp.
        notes: Other numbers for the table of trials, such as ``ik_calls``.
    """

    outcome: GraspOutcome
    detail: str = ""
    committed_s: float | None = None
    lifted_s: float | None = None
    thinking_s: float = 0.0
    attempts: int = 0
    loops: int = 0
    switches: int = 0
    notes: dict[str, float] = field(default_factory=dict)


@runtime_checkable
class DynamicMethod(Protocol):
    """A way to grasp what moves. One instance serves many trials, one after the other."""

    @property
    def name(self) -> str:
        """In tables."""
        ...

    def run(self, station: Station, task: DynamicTask) -> MethodResult:
        """Grasp and lift, or find out why not; return when done, the object still held.

        Time passes in ``station.world.wait`` and ``charge``. The judge of a trial ends it early, when something has
        gone wrong for good, by raising :class:`TrialOver` from there: let it pass.
        """
        ...


class TrialOver(Exception):
    """The judge has ended the trial.

    Attributes:
        outcome: Why.
        detail: More about it.
    """

    def __init__(self, outcome: GraspOutcome, detail: str = "") -> None:
        super().__init__(f"{outcome.label}{': ' if detail else ''}{detail}")
        self.outcome, self.detail = outcome, detail
