"""The world of Task I: robot, workspace, objects, camera, reward."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from tr_grasp.configs.appearance import AppearanceCfg
from tr_grasp.configs.camera import CameraCfg
from tr_grasp.configs.checks import require, require_range
from tr_grasp.configs.randomisation import RandomisationCfg


@dataclass(frozen=True)
class WorkspaceCfg:
    """The cube in which objects lie, the tool moves and the octree is built (base frame)."""

    centre_m: tuple[float, float, float] = (0.5, 0.0, 0.1125)
    """Centre of the octree's cube; its floor lies half a leaf under the table so that the table is seen."""

    side_m: float = 0.24
    """Edge of the octree's cube; also the width and depth of the area the tool may reach."""

    tcp_height_m: tuple[float, float] = (0.012, 0.26)
    """Lowest and highest tool height above the table. The fingertips end 9 mm under the tcp."""

    escape_margin_m: float = 0.05
    """An object farther outside the cube than this counts as fallen out."""

    def __post_init__(self) -> None:
        require(self.side_m > 0, f"workspace.side_m must be positive, got {self.side_m}")
        low, high = self.tcp_height_m
        require(0 < low < high, f"workspace.tcp_height_m must be 0 < low < high, got {self.tcp_height_m}")


@dataclass(frozen=True)
class ActionCfg:
    """What one policy step does to the tool."""

    translation_step_m: float = 0.05
    """Tool translation per axis for an action component of 1."""

    yaw_step_rad: float = 0.4
    """Tool turn about the vertical for an action component of 1."""

    gripper_dead_zone: float = 0.0
    """Gripper components smaller than this keep the last command (the thesis uses 0.25 without colour)."""

    execution: Literal["cartesian", "planned"] = "cartesian"
    """``cartesian``: straight to the joints of the next tool pose; ``planned``: a motion that is planned in 0.1 s,
    touches neither the arm nor the table, and is timed by the arm's limits (thesis, with MoveIt)."""

    latency_s: tuple[float, float] = (0.0, 0.1)
    """Time between a command and its effect if ``randomise.latency`` draws it; uniform over whole physics steps."""

    def __post_init__(self) -> None:
        require_range("action.latency_s", self.latency_s, at_least=0.0)


@dataclass(frozen=True)
class ObjectsCfg:
    """What is to be grasped and how it lies."""

    source: str = "procedural"
    """``procedural``; ``procedural_wide``, which has families that are wider than a hand besides; a folder of meshes in
    the package's layout, that of ManiSkill's YCB or of Google Scanned Objects; or the name of one in the folder that
    the variable TR_GRASP_OBJECTS names."""

    overlap: Literal["refuse", "leave_out"] = "refuse"
    """A folder with the same object in both splits: refuse it, or leave that object out of the test split."""

    orientation: Literal["uniform", "upright_yaw", "thesis"] = "uniform"
    """How objects are turned before they drop: uniform on SO(3); upright, turned about the vertical; or the thesis'
    normalised U(-1, 1)^4, which is not uniform."""

    split: Literal["train", "test"] = "train"
    """Training and test objects never overlap: other sizes, and some families only in one of them."""

    count_range: tuple[int, int] = (1, 4)
    """Fewest and most objects in an episode."""

    lone_wide_share: float = 0.0
    """Share of the scenes that hold one object alone, of the families that are wider than a hand; where there are
    others, those are lifted instead. Only with ``procedural_wide``."""

    arrangement: Literal["scattered", "pile", "mixed"] = "scattered"
    """``scattered``: dropped one by one, apart; ``pile``: dropped on top of each other in the middle; ``mixed``: one of
    the two, drawn for each scene."""

    spread: float = 0.7
    """Scattered objects start in a square that is this share of ``workspace.side_m`` wide."""

    diagonal_range_m: tuple[float, float] = (0.125, 0.175)
    """Objects from meshes are scaled so that their bounding-box diagonal falls in this range (thesis)."""

    mass_range_kg: tuple[float, float] = (0.05, 0.25)
    """Mass of an object, uniform."""

    friction_range: tuple[float, float] = (0.75, 1.5)
    """Friction coefficient of an object, uniform."""

    def __post_init__(self) -> None:
        low, high = self.count_range
        require(1 <= low <= high <= 8, f"objects.count_range must be 1 <= low <= high <= 8, got {self.count_range}")
        for name in ("diagonal_range_m", "mass_range_kg", "friction_range"):
            low, high = getattr(self, name)
            require(0 < low <= high, f"objects.{name} must be 0 < low <= high, got {(low, high)}")
        share = self.lone_wide_share
        require(0 <= share <= 1, f"objects.lone_wide_share must be in [0, 1], got {share}")
        require(
            not share or self.source == "procedural_wide",
            f"objects.lone_wide_share asks for objects of procedural_wide, and objects.source is {self.source!r}; "
            "choose objects.source procedural_wide or objects.lone_wide_share 0",
        )
        require(0 < self.spread <= 1, f"objects.spread must be in (0, 1], got {self.spread}")


@dataclass(frozen=True)
class ObservationCfg:
    """What the policy is given."""

    depth: int = 4
    """Octree depth; a leaf is ``workspace.side_m / 2**depth`` wide."""

    leaf_capacity: int = 512
    """Leaves kept per octree; beyond it the leaves with the fewest points are left out."""

    colour: bool = True
    """Seven channels per leaf (mean normal, signed distance, colour) instead of four."""

    stack_n: int = 3
    """Stacked observations, oldest first."""

    gripper_reading: Literal["measured", "commanded"] = "measured"
    """First number of the proprioception: measured opening, or the last command (thesis)."""

    image: bool = False
    """Add what the camera saw, as a colour and a depth picture for each stacked observation."""

    expert_labels: bool = False
    """Add the scripted expert's action (for imitation while training; never at run time)."""

    def __post_init__(self) -> None:
        require(3 <= self.depth <= 6, f"observation.depth must be 3..6, got {self.depth}")
        require(self.leaf_capacity >= 16, f"observation.leaf_capacity must be at least 16, got {self.leaf_capacity}")
        require(1 <= self.stack_n <= 8, f"observation.stack_n must be 1..8, got {self.stack_n}")


@dataclass(frozen=True)
class RewardCfg:
    """Sparse stages paid once an episode: base**0, base**1, base**2, base**3."""

    stage_base: float = 7.0
    """Reach, touch, grasp, lift pay 1, 7, 49, 343 (thesis)."""

    ground_contact: float = -1.0
    """For each step in which the robot touches the table."""

    step: float = -0.005
    """For every step."""

    reach_distance_m: float = 0.10
    """The tcp is this near to an object's centre: reached."""

    lift_height_m: float = 0.125
    """A held object is this high: lifted, success."""

    lift_reference: Literal["rest", "table"] = "rest"
    """Measure the lift from where the object came to rest, or from the table (thesis)."""


@dataclass(frozen=True)
class EnvCfg:
    """Task I: grasp one of several novel objects and lift it."""

    robot: str = "panda"
    """The arm and its gripper: panda, ur5_rg2, ur5_robotiq_2f85, j2s7s300, or the YAML file of your own."""

    control_hz: float = 4.0
    """Policy steps per second of simulated time."""

    physics_hz: int = 100
    """Physics steps per second of simulated time."""

    contact_iterations: int = 40
    """Solver iterations of a physics step for objects that lie or are held, and for what touches them. With 15, as
    policies were trained before there was this setting, friction holds less than its coefficient says."""

    episode_steps: int = 100
    """Policy steps after which an episode is truncated."""

    fresh_scene_every_n: int = 1
    """Episodes between complete rebuilds of the scene; 1 makes every episode bit-repeatable."""

    initial_joint_noise_rad: float = 0.03
    """Standard deviation of the noise on every arm joint at reset (thesis: 0.1)."""

    gravity_sigma_mps2: float = 0.02
    """Standard deviation of the strength of gravity around 9.81 m/s^2 if ``randomise.gravity`` draws it."""

    randomise: RandomisationCfg = field(default_factory=RandomisationCfg)
    """What differs between episodes."""

    workspace: WorkspaceCfg = field(default_factory=WorkspaceCfg)
    """Where things happen."""

    action: ActionCfg = field(default_factory=ActionCfg)
    """What a step does."""

    objects: ObjectsCfg = field(default_factory=ObjectsCfg)
    """What is grasped."""

    camera: CameraCfg = field(default_factory=CameraCfg)
    """What sees it."""

    appearance: AppearanceCfg = field(default_factory=AppearanceCfg)
    """How differently it may look."""

    observation: ObservationCfg = field(default_factory=ObservationCfg)
    """What the policy is given."""

    reward: RewardCfg = field(default_factory=RewardCfg)
    """What it is paid."""

    def __post_init__(self) -> None:
        require(self.control_hz > 0, f"env.control_hz must be positive, got {self.control_hz}")
        substeps = self.physics_hz / self.control_hz
        require(
            substeps >= 1 and abs(substeps - round(substeps)) < 1e-9,
            f"env.physics_hz must be a multiple of env.control_hz, got {self.physics_hz} and {self.control_hz}",
        )
        require(
            self.initial_joint_noise_rad >= 0,
            f"env.initial_joint_noise_rad must not be negative, got {self.initial_joint_noise_rad}",
        )
        require(
            0 <= self.gravity_sigma_mps2 <= 2.0,
            f"env.gravity_sigma_mps2 must be in [0, 2], got {self.gravity_sigma_mps2}",
        )
        require(
            not self.randomise.latency or self.action.latency_s[1] <= 1.0 / self.control_hz,
            f"env.action.latency_s must not exceed the control period of {1.0 / self.control_hz:g} s, "
            f"got {self.action.latency_s}",
        )
        require(
            not (self.randomise.latency and self.action.execution == "planned"),
            "env.randomise.latency works with env.action.execution cartesian only, got planned",
        )
        require(
            1 <= self.contact_iterations <= 255,
            f"env.contact_iterations must be 1..255, got {self.contact_iterations}",
        )
        require(self.episode_steps >= 1, f"env.episode_steps must be at least 1, got {self.episode_steps}")
        require(
            self.fresh_scene_every_n >= 1, f"env.fresh_scene_every_n must be at least 1, got {self.fresh_scene_every_n}"
        )
