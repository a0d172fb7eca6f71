"""What it means to try a grasp: settings, the motion of the hand over time, and the protocol of whoever tries."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tr_grasp.errors import GraspError
from tr_grasp.grasps.poses import Grasps

Array = NDArray[np.floating]


@dataclass(frozen=True)
class TrialCfg:
    """One try: the object is misplaced at random, then the hand approaches, closes, lifts, shakes and holds."""

    shift_m: float = 0.01
    """The object is moved by up to this along x and along y."""

    turn_deg: float = 20.0
    """The object is turned by up to this about the vertical through its origin."""

    friction: float = 0.9
    """Of object and table; fingers have 1.5."""

    approach_m: float = 0.075
    """The open hand starts this far back."""

    lift_m: float = 0.1
    """How far the hand rises."""

    raised_share: float = 0.75
    """Part of the lift by which the object must have risen at the end."""

    shake_m: float = 0.015
    """Amplitude of the shake, sideways, along both axes at once."""

    approach_s: float = 0.25
    """Duration of the approach."""

    settle_s: float = 0.15
    """Time to build up force after the fingers have met the object."""

    lift_s: float = 0.3
    """Duration of the lift."""

    shake_s: float = 0.3
    """Duration of the shake, one swing to either side."""

    hold_s: float = 0.12
    """The hand stands still this long before the grasp is judged."""

    physics_hz: int = 100
    """Simulation steps per second."""

    solver_iterations: int = 40
    """Of the contact solver in each step; with 15, most grasps of a heavy drill slip that hold with 40."""

    parallel_n: int = 48
    """Hands side by side in one scene."""

    def __post_init__(self) -> None:
        """Refuse what has no meaning.

        Raises:
            GraspError: A negative length, or nothing to lift.
        """
        for name in ("shift_m", "turn_deg", "friction", "approach_m", "shake_m", "settle_s", "hold_s"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) >= 0):
                raise GraspError(f"{name} must not be negative, got {getattr(self, name)}.")
        for name in (
            "lift_m",
            "raised_share",
            "approach_s",
            "lift_s",
            "shake_s",
            "physics_hz",
            "solver_iterations",
            "parallel_n",
        ):
            if not getattr(self, name) > 0:
                raise GraspError(f"{name} must be positive, got {getattr(self, name)}.")


class TryGrasps(Protocol):
    """Tries each grasp once on a misplaced object; how, is its own business."""

    def __call__(self, grasps: Grasps, rng: np.random.Generator) -> NDArray[np.bool_]:
        """(n,) whether each of n grasps held."""
        ...


@dataclass(frozen=True)
class HandMotion:
    """Where the hand is and when it closes; it never turns.

    Attributes:
        cfg: The trial.
        close_s: How long it waits for the fingers.
    """

    cfg: TrialCfg
    close_s: float

    @property
    def duration_s(self) -> float:
        """Of the whole trial."""
        return self.cfg.approach_s + self.close_s + self.cfg.lift_s + self.cfg.shake_s + self.cfg.hold_s

    def closing_at(self, time_s: float) -> bool:
        """Whether the fingers are told to close."""
        return time_s > self.cfg.approach_s

    def back_at(self, time_s: float) -> float:
        """How far the hand is still before its grasp [m]."""
        return self.cfg.approach_m * (1.0 - _smooth(time_s / self.cfg.approach_s))

    def moved_at(self, time_s: float) -> Array:
        """(3,) how far the hand has gone from its grasp, in the axes of the world [m]."""
        after = time_s - self.cfg.approach_s - self.close_s
        rise = self.cfg.lift_m * _smooth(after / self.cfg.lift_s)
        phase = np.clip((after - self.cfg.lift_s) / self.cfg.shake_s, 0.0, 1.0)
        # One period of a sine that starts and ends softly.
        aside = self.cfg.shake_m * np.sin(2 * np.pi * _smooth(phase)) / np.sqrt(2)
        return np.array([aside, aside, rise])


def _smooth(share: float) -> float:
    """From 0 to 1 at rest on either end (cubic)."""
    s = min(max(share, 0.0), 1.0)
    return s * s * (3 - 2 * s)
