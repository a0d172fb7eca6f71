"""A pick-and-place station as plain data: robot, poses, stages, what stands around, and what is carried."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from tr_grasp.configs.checks import require
from tr_grasp.errors import unknown_name
from tr_grasp.geometry import matrix_from_wxyz, transform_from, wxyz_from_matrix

Array = NDArray[np.floating]
Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
Action = Literal["move", "line", "close", "open"]
HOME = "home"
UNIT_TOLERANCE = 1e-2


@dataclass(frozen=True)
class PoseCfg:
    """A pose of the station's ``pose_link``: its own numbers, or another pose of the file that is backed off."""

    position_m: Vector | None = None
    """In the base frame."""

    orientation_xyzw: Quaternion | None = None
    """Unit quaternion, scalar last, as the thesis and ROS write them."""

    like: str | None = None
    """The pose that this one is derived from."""

    back_off_m: float = 0.0
    """How far the hand is drawn back against its own z, the direction of approach."""

    lift_m: float = 0.0
    """How far it is raised along z of the base."""

    def __post_init__(self) -> None:
        own = self.position_m is not None and self.orientation_xyzw is not None
        none = self.position_m is None and self.orientation_xyzw is None
        require(
            own if self.like is None else none,
            "a pose must have position_m and orientation_xyzw, or like and nothing of these",
        )
        if self.orientation_xyzw is not None:
            length = float(np.linalg.norm(self.orientation_xyzw))
            require(
                abs(length - 1) < UNIT_TOLERANCE,
                f"orientation_xyzw must be a unit quaternion, got {list(self.orientation_xyzw)} of length {length:.3f}",
            )
        for name in ("back_off_m", "lift_m"):
            require(getattr(self, name) >= 0, f"{name} must not be negative, got {getattr(self, name)}")

    @classmethod
    def of(cls, T_base_link: Array) -> PoseCfg:
        """A pose with the numbers of a matrix (4, 4)."""
        w, x, y, z = (float(value) for value in wxyz_from_matrix(T_base_link[:3, :3]))
        px, py, pz = (float(value) for value in T_base_link[:3, 3])
        return cls((px, py, pz), (x, y, z, w))

    def matrix(self) -> Array:
        """``T_base_link`` (4, 4) of a pose with its own numbers."""
        assert self.position_m is not None
        assert self.orientation_xyzw is not None
        x, y, z, w = self.orientation_xyzw
        return transform_from(matrix_from_wxyz([w, x, y, z]), self.position_m)


@dataclass(frozen=True)
class StageCfg:
    """One step of the task."""

    name: str = ""
    """For people."""

    do: Action = "move"
    """``move`` anywhere it is free, ``line`` straight with the tool, ``close`` or ``open`` the fingers."""

    to: str = ""
    """Where a motion ends: a pose of the file, or home."""

    def __post_init__(self) -> None:
        moves = self.do in ("move", "line")
        require(bool(self.name), "a stage must have a name")
        require(bool(self.to) == moves, f"stage {self.name!r}: {self.do} {'needs' if moves else 'must not have'} 'to'")


@dataclass(frozen=True)
class BoxCfg:
    """A box that stands still."""

    size_m: Vector = (0.1, 0.1, 0.1)
    """Its edges."""

    centre_m: Vector = (0.0, 0.0, 0.0)
    """Its middle in the base frame."""

    yaw_deg: float = 0.0
    """Turn about the vertical."""

    margin_m: float = 0.0
    """By which it grows for planning: what is carried hangs in the hand a little otherwise than planned."""

    colour: Vector = (0.6, 0.6, 0.6)
    """Red, green, blue in [0, 1]."""

    def __post_init__(self) -> None:
        require(min(self.size_m) > 0, f"size_m must be positive, got {list(self.size_m)}")
        require(self.margin_m >= 0, f"margin_m must not be negative, got {self.margin_m}")


@dataclass(frozen=True)
class ObjectCfg:
    """The upright bottle that is carried; planning takes it for a cylinder."""

    radius_m: float = 0.03
    """Of its body."""

    height_m: float = 0.24
    """From foot to cap."""

    mass_kg: float = 0.2
    """Its mass."""

    friction: float = 1.2
    """Coefficient of its surface."""

    foot_m: Vector = (0.5, 0.0, 0.0)
    """Middle of its foot, base frame: where the taught grasp expects it."""

    def __post_init__(self) -> None:
        for name in ("radius_m", "height_m", "mass_kg", "friction"):
            require(getattr(self, name) > 0, f"object.{name} must be positive, got {getattr(self, name)}")

    @property
    def T_base_object(self) -> Array:
        """(4, 4) the middle of its height."""
        x, y, z = self.foot_m
        return transform_from(np.eye(3), (x, y, z + self.height_m / 2))


@dataclass(frozen=True)
class StationCfg:
    """Everything that a pick-and-place task is told before it starts.

    Raises:
        ConfigError: Stages without a grip, a name that does not exist, poses that refer to each other in a ring.
    """

    robot: str = "j2s7s300"
    """Name of the arm, or the YAML file of your own."""

    pose_link: str = "tcp"
    """Link of the robot whose poses are given."""

    home_q_rad: tuple[float, ...] = ()
    """Arm joints at home; the robot's own home if there are none."""

    speed_share: float = 0.6
    """Part of the arm's rated speed and acceleration."""

    grip_force_n: float | None = None
    """Force of the grip; the gripper's usual one, if not given."""

    poses: Mapping[str, PoseCfg] = field(default_factory=dict)
    """By name."""

    stages: tuple[StageCfg, ...] = ()
    """In order."""

    object: ObjectCfg = field(default_factory=ObjectCfg)
    """What is carried."""

    boxes: Mapping[str, BoxCfg] = field(default_factory=dict)
    """What must not be run into, by name."""

    not_to_touch: tuple[str, ...] = ()
    """Boxes whose every touch is counted."""

    search_m: tuple[Vector, Vector] | None = None
    """Lowest and highest corner of where a camera looks for the object; nothing else may stand there."""

    goal_m: tuple[Vector, Vector] | None = None
    """Lowest and highest corner of where the object's middle must end; judged in simulation only."""

    def __post_init__(self) -> None:
        require(0 < self.speed_share <= 1, f"speed_share must be above 0 and at most 1, got {self.speed_share}")
        require(bool(self.stages), "stages must not be empty")
        for name in ("search_m", "goal_m"):
            region = getattr(self, name)
            rises = region is None or all(a < b for a, b in zip(*region, strict=True))
            require(rises, f"{name} must be a lowest and a highest corner, got {region}")
        for stage in self.stages:
            known = not stage.to or stage.to == HOME or stage.to in self.poses
            require(known, f"stage {stage.name!r}: {unknown_name('pose', stage.to, [HOME, *self.poses])}")
        for name in self.not_to_touch:
            require(name in self.boxes, f"not_to_touch: {unknown_name('box', name, self.boxes)}")
        grips = [stage.do for stage in self.stages if stage.do in ("close", "open")]
        require(grips == ["close", "open"], f"stages must close the fingers once and then open them, got {grips}")
        closing = self._stage_of("close")
        require(closing >= 2, "stages must go to a pre-grasp and to a grasp before the fingers close")
        require(self.stages[closing - 1].to != HOME, "stages must not close the fingers at home")
        for name in self.poses:
            self.T_base_link(name)

    def T_base_link(self, name: str) -> Array:
        """(4, 4) of a named pose, derived ones worked out."""
        back_off, lift, seen = 0.0, 0.0, [name]
        pose = self.poses[name]
        while pose.like is not None:
            back_off, lift = back_off + pose.back_off_m, lift + pose.lift_m
            require(pose.like in self.poses, f"poses.{name}: {unknown_name('pose', pose.like, self.poses)}")
            require(pose.like not in seen, f"poses.{name}: is derived from itself, by way of {' and '.join(seen)}")
            seen.append(pose.like)
            pose = self.poses[pose.like]
        T = pose.matrix()
        T[:3, 3] -= (back_off + pose.back_off_m) * T[:3, 2]
        T[2, 3] += lift + pose.lift_m
        return T

    def with_object_at(self, x_m: float, y_m: float) -> StationCfg:
        """The same with the object's foot somewhere else on its plane."""
        foot = (float(x_m), float(y_m), self.object.foot_m[2])
        return replace(self, object=replace(self.object, foot_m=foot))

    def with_grasp_shifted(self, shift_m: Vector) -> StationCfg:
        """The same with all poses up to the grip's lift moved along: the object was seen to be elsewhere."""
        roots = {self._root(name) for name in (self.grasp, *self.near_grasp)}
        moved = {
            name: replace(pose, position_m=tuple(float(a + b) for a, b in zip(pose.position_m, shift_m, strict=True)))
            if name in roots and pose.position_m is not None
            else pose
            for name, pose in self.poses.items()
        }
        return replace(self, poses=moved)

    def with_poses(self, T_base_link: Mapping[str, Array]) -> StationCfg:
        """The same with other numbers (4, 4) for some poses; those derived from them follow."""
        poses = {name: PoseCfg.of(T) for name, T in T_base_link.items()}
        return replace(self, poses={**self.poses, **poses})

    @property
    def approach(self) -> list[str]:
        """Names of the poses before the grip, in order; the last is the grasp."""
        return [stage.to for stage in self.stages[: self._stage_of("close")] if stage.to]

    @property
    def grasp(self) -> str:
        """Name of the pose at which the fingers close."""
        return self.approach[-1]

    @property
    def near_grasp(self) -> list[str]:
        """Names of the poses before the grasp and of the lift after it."""
        stages = self.stages[: self._stage_of("close") + 2]
        return sorted({stage.to for stage in stages} - {HOME, "", self.grasp})

    @property
    def place(self) -> str:
        """Name of the pose at which they open."""
        return next(stage.to for stage in reversed(self.stages[: self._stage_of("open")]) if stage.to)

    def _stage_of(self, action: Action) -> int:
        return next(i for i, stage in enumerate(self.stages) if stage.do == action)

    def _root(self, name: str) -> str:
        while (parent := self.poses[name].like) is not None:
            name = parent
        return name
