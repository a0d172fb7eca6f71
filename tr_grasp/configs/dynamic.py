"""The world of Task II: what rides where and how fast, how it is tracked, what thinking costs, when it is a success."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from tr_grasp.configs.checks import require

Work = Literal["ranking", "inverse_kinematics", "planning"]
DynamicMotion = Literal[
    "linear",
    "linear_obstacles",
    "linear_slab",
    "circular",
    "sinusoidal",
    "linear_z",
    "varying_speed",
    "rotating",
    "bezier",
    "random_turns",
]
DynamicObject = Literal[
    "021_bleach_cleanser", "010_potted_meat_can", "035_power_drill", "006_mustard_bottle", "004_sugar_box"
]

THESIS_MOTIONS: tuple[DynamicMotion, ...] = ("linear", "linear_obstacles", "linear_slab", "circular", "sinusoidal")
"""Those of the thesis' tables, in their order."""
MORE_MOTIONS: tuple[DynamicMotion, ...] = ("linear_z", "varying_speed", "rotating", "bezier", "random_turns")
"""Those that the thesis does not have."""
DYNAMIC_OBJECTS: tuple[DynamicObject, ...] = (
    "021_bleach_cleanser",
    "010_potted_meat_can",
    "035_power_drill",
    "006_mustard_bottle",
    "004_sugar_box",
)
"""In the order of the thesis' tables."""


@dataclass(frozen=True)
class ChargesCfg:
    """What thinking costs in time of the world."""

    mode: Literal["measured", "fixed", "free"] = "measured"
    """``measured``: the time that it took; ``fixed``: what the thesis' simulation charges, whatever it took; ``free``:
    the world stands still, for debugging."""

    clock: Literal["wall", "cpu"] = "wall"
    """Which time is measured: the wall clock's, or the thread's on the processor, which other processes do not slow."""

    ranking_s: float = 0.135
    """Fixed charge of ranking the grasps once."""

    inverse_kinematics_s: float = 0.01
    """Fixed charge of each inverse-kinematics call."""

    planning_s: float = 0.14
    """Fixed charge of planning one motion."""

    def __post_init__(self) -> None:
        for name in ("ranking_s", "inverse_kinematics_s", "planning_s"):
            require(getattr(self, name) >= 0, f"charges.{name} must not be negative, got {getattr(self, name)}")

    def cost_s(self, work: Work, measured_s: float, calls_n: int = 1) -> float:
        """Time to charge for work that took ``measured_s``; fixed charges are for each of ``calls_n`` calls."""
        if self.mode == "measured":
            return measured_s
        return 0.0 if self.mode == "free" else calls_n * float(getattr(self, f"{work}_s"))


@dataclass(frozen=True)
class TrackingCfg:
    """How the target's pose is measured."""

    rate_hz: float = 30.0
    """Readings per second; 5 in the thesis."""

    latency_s: float = 0.0
    """How long after it was true a reading arrives."""

    noise_m: float = 0.0
    """Standard deviation of the position, per axis."""

    noise_rad: float = 0.0
    """Standard deviation of the orientation, per axis."""

    dropout_share: float = 0.0
    """Part of the readings that never arrive."""

    def __post_init__(self) -> None:
        require(self.rate_hz > 0, f"tracking.rate_hz must be positive, got {self.rate_hz}")
        for name in ("latency_s", "noise_m", "noise_rad"):
            require(getattr(self, name) >= 0, f"tracking.{name} must not be negative, got {getattr(self, name)}")
        require(0 <= self.dropout_share <= 1, f"tracking.dropout_share must be in [0, 1], got {self.dropout_share}")


@dataclass(frozen=True)
class JudgeCfg:
    """When a trial is a success, and what ends it."""

    lift_m: float = 0.07
    """How far up the method is to take the object."""

    lifted_m: float = 0.03
    """How far up it must be at the end."""

    hold_s: float = 2.0
    """For how long after the lift it must stay there."""

    target_drop_m: float = 0.03
    """A target lower than this under its place on the carrier is knocked over."""

    target_tilt_deg: float = 45.0
    """A target that leans further than this before it is held is knocked over."""

    obstacle_tilt_deg: float = 15.0
    """An obstacle that leans further is overturned."""

    obstacle_shift_m: float = 0.02
    """An obstacle that moves further is pushed away."""

    grace_s: float = 3.0
    """For how long a grasp that was begun before the end of the path may go on after it."""

    def __post_init__(self) -> None:
        for name in ("lift_m", "lifted_m", "target_drop_m", "obstacle_tilt_deg", "obstacle_shift_m"):
            require(getattr(self, name) > 0, f"judge.{name} must be positive, got {getattr(self, name)}")
        require(self.hold_s >= 0, f"judge.hold_s must not be negative, got {self.hold_s}")
        require(self.grace_s >= 0, f"judge.grace_s must not be negative, got {self.grace_s}")
        require(
            self.lifted_m < self.lift_m,
            f"judge.lifted_m must be below judge.lift_m = {self.lift_m}, got {self.lifted_m}",
        )


@dataclass(frozen=True)
class DynamicCfg:
    """The world ``DynamicGrasp-v1``."""

    robot: str = "ur5_robotiq_2f85"
    """A robot's name, or the YAML file of your own."""

    home: Literal["thesis", "robot"] = "thesis"
    """Where the arm waits: as in the thesis (UR5 only: half a metre up, the hand to the side), or the robot's own."""

    models: str = "primitive"
    """``primitive`` for plain solids of the same size and mass, or a folder of YCB meshes, one sub-folder each."""

    grasps: str | None = None
    """Folder of grasp sets, OBJECT.grasps.safetensors each; without it, those that come with the package for the plain
    solids."""

    speed_m_s: float = 0.03
    """Of the carrier on its path; along the middle line, if the path is a sine. The thesis names none; see the facts in
    the results."""

    target_mass_kg: float | None = None
    """Mass of the target; the real object's, if not given. The thesis' simulation has 1 kg."""

    friction: float = 0.9
    """Between the target and whatever touches it."""

    freeze_on_lift: bool = False
    """The carrier stops when the object is lifted, as in the thesis' simulation."""

    tell_path_end: bool = True
    """The method knows when the path ends."""

    physics_hz: int = 240
    """Physics steps per second."""

    tracking: TrackingCfg = field(default_factory=TrackingCfg)
    """How the target's pose is measured."""

    charges: ChargesCfg = field(default_factory=ChargesCfg)
    """What thinking costs."""

    judge: JudgeCfg = field(default_factory=JudgeCfg)
    """When a trial is a success, and what ends it."""

    def __post_init__(self) -> None:
        require(self.speed_m_s > 0, f"speed_m_s must be positive, got {self.speed_m_s}")
        require(self.friction >= 0, f"friction must not be negative, got {self.friction}")
        require(self.physics_hz >= 60, f"physics_hz must be at least 60, got {self.physics_hz}")
        mass = self.target_mass_kg
        require(mass is None or mass > 0, f"target_mass_kg must be positive, got {mass}")
