"""Settings of the dynamic grasper; each field is one switch of an ablation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from tr_grasp.errors import ConfigError
from tr_grasp.grasps.ranking import RankingName
from tr_grasp.motion.limits import LimitsName

PlannerName = Literal["intercept", "thesis"]
PredictorName = Literal[
    "hold", "constant_velocity", "kalman_thesis", "kalman", "mlp", "lstm", "harmonic_bank", "hybrid"
]
MotionClass = Literal["linear", "circular", "sinusoidal"]


@dataclass(frozen=True)
class GrasperCfg:
    """How a moving object is grasped.

    Raises:
        ConfigError: A value outside its range.
    """

    planner: PlannerName = "intercept"
    """``thesis`` is its Algorithm 1; ``intercept`` searches for where and when to meet the object."""

    predictor: PredictorName = "hybrid"
    """Who says where the object will be."""

    motion_class: MotionClass = "linear"
    """Class of motion of the thesis' networks, which have to be told; others ignore it."""

    ranking: RankingName = "ours"
    """Which grasps are looked at first, or only: see :func:`tr_grasp.grasps.ranking.rank_grasps`."""

    least_held: float = 0.0
    """Share of its tries on an object at rest that a grasp must have held to be used; the thesis keeps those that
    never failed."""

    limits: LimitsName = "rated"
    """Of the arm on its ways: as rated, or as the thesis' MoveIt timed its plans, a tenth of the rated speed and
    0.1 rad/s²."""

    approach_limits: LimitsName = "rated"
    """Of the arm near the object: from the pre-grasp on until the fingers are closed, and when the hand draws back. The
    thesis does not limit its approach, its drives even jump onto the first waypoint; ``rated`` is as fast as an arm can
    follow."""

    seeding: bool = True
    """Plans begin with what is left of the one before, from the speed that the arm has."""

    switching: bool = True
    """Another grasp may be chosen on the way."""

    retry: bool = True
    """A grasp that missed is tried again while the path remains."""

    look_ahead: bool = True
    """Go to where the object will be; without it, to where it is."""

    back_off_m: float = 0.075
    """Distance of the pre-grasp from the grasp, against the approach direction."""

    horizon_s: float = 10.0
    """How far ahead ``intercept`` looks for a meeting, but at least twice as far as half a turn of a joint takes."""

    close_within_m: float = 0.005
    """``intercept`` closes the fingers only when the hand is this near to the grasp."""

    close_within_deg: float = 5.0
    """And turned by less than this."""

    switch_gain: float = 0.2
    """``intercept`` changes its mind for a meeting that comes earlier by this share of the time left."""

    lost_after_s: float = 2.0
    """An object that was not seen for so long is lost."""

    hopeless_after_s: float = 2.0
    """``intercept`` gives up when for so long no meeting was in sight, as far ahead as it looks."""

    attempts_n: int = 5
    """How often ``intercept`` closes its fingers at most."""

    def __post_init__(self) -> None:
        positive = ("back_off_m", "horizon_s", "close_within_m", "close_within_deg", "lost_after_s", "attempts_n")
        for name in (*positive, "hopeless_after_s"):
            if not getattr(self, name) > 0:
                raise ConfigError(f"grasper.{name} must be positive, got {getattr(self, name)}.")
        if not 0 <= self.least_held <= 1:
            raise ConfigError(f"grasper.least_held must be in [0, 1], got {self.least_held}.")
        if not 0 <= self.switch_gain < 1:
            raise ConfigError(f"grasper.switch_gain must be in [0, 1), got {self.switch_gain}.")

    @classmethod
    def thesis(cls) -> GrasperCfg:
        """The thesis' own conditions: its algorithm, filter, choice of grasps and limits, and no second attempt."""
        return cls(
            planner="thesis", predictor="kalman_thesis", ranking="both", least_held=1.0, limits="thesis", retry=False
        )  # fmt: skip
