"""A robot of one's own: a URDF file and a few lines of YAML that say which of its joints do what.

urdf: my_robot.urdf             # beside this file
base_link: base
tcp_link: tool                  # between the fingertips; z out of the hand, fingers close along y
arm_joints: [j1, j2, j3, j4, j5, j6]
home_q_rad: [0, -1.57, 1.57, -1.57, -1.57, 0]
gripper:
  joints: [left_finger, right_finger]
  closed: [0, 0]
  open: [0.04, 0.04]
  opening_m: 0.08               # between the open fingers
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from tr_grasp.configs.io import load_cfg
from tr_grasp.errors import ConfigError, unknown_name
from tr_grasp.robots.parts import FingerSpec, GripperSpec, JointSpec
from tr_grasp.robots.spec import RobotSpec, robot_names
from tr_grasp.robots.tree import arm_between
from tr_grasp.robots.urdf_checks import check_masses
from tr_grasp.robots.urdf_reader import UrdfFile


@dataclass(frozen=True)
class GripperCfg:
    """The fingers; joints that follow each other along a finger move together."""

    joints: tuple[str, ...] = ()
    """The joints of the fingers, each finger from the hand outwards."""

    closed: tuple[float, ...] = ()
    """Where each joint is when the gripper is closed [rad or m]."""

    open: tuple[float, ...] = ()
    """Where each joint is when it is open [rad or m]."""

    opening_m: float = 0.08
    """Distance between the open fingers; closed ones touch."""

    speed_mps: float = 0.1
    """How fast the opening changes."""

    force_n: float = 40.0
    """With what force it grips."""

    stiffness: float = 1000.0
    """Gain of the finger joints [N/m or N m/rad]."""

    def __post_init__(self) -> None:
        if not len(self.joints) == len(self.closed) == len(self.open) > 0:
            raise ConfigError(
                "gripper.joints, gripper.closed and gripper.open must have one value for each joint, got "
                f"{len(self.joints)}, {len(self.closed)} and {len(self.open)}"
            )
        for name in ("opening_m", "speed_mps", "force_n", "stiffness"):
            if getattr(self, name) <= 0:
                raise ConfigError(f"gripper.{name} must be positive, got {getattr(self, name)}")


@dataclass(frozen=True)
class RobotCfg:
    """What the YAML of a robot says."""

    name: str = ""
    """Its name; the YAML's own if empty."""

    urdf: Path = Path()
    """The URDF, from the YAML's folder."""

    base_link: str = ""
    """Link that stands still."""

    tcp_link: str = ""
    """Frame between the fingertips."""

    arm_joints: tuple[str, ...] = ()
    """Joints of the arm, base to tip."""

    home_q_rad: tuple[float, ...] = ()
    """Where the arm starts, with the tool pointing down."""

    acceleration_rad_s2: float = 8.0
    """Largest acceleration of the arm joints, for which URDF has no place."""

    jerk_rad_s3: float = 80.0
    """Largest jerk of the arm joints."""

    gripper: GripperCfg = field(default_factory=lambda: GripperCfg(joints=("",), closed=(0.0,), open=(1.0,)))
    """The fingers."""


def load_robot(path: str | Path) -> RobotSpec:
    """A robot from a YAML file as in this module's text.

    Raises:
        ConfigError: A file that is missing, an unknown field, link or joint, joints that are not the way from base to
            tcp, missing limits, a mimic joint, a missing mesh, a link without mass or inertia, a name that is taken.
    """
    path = Path(path)
    if not path.is_file():
        raise ConfigError(f"there is no robot at '{path}'; give a YAML file, or one of: {', '.join(robot_names())}.")
    cfg = load_cfg(RobotCfg(), path)
    name = cfg.name or path.stem
    if name in robot_names():
        raise ConfigError(f"{path}: the name {name!r} is taken by a robot of this package; set another by 'name:'.")
    file = UrdfFile(path.parent / cfg.urdf)
    joints = {joint.name: joint for joint in file.joints if joint.kind != "fixed"}
    _check_names("link", [cfg.base_link, cfg.tcp_link], [link.name for link in file.links], path)
    _check_names("joint", [*cfg.arm_joints, *cfg.gripper.joints], list(joints), path)
    arm = arm_between(file, cfg.base_link, cfg.tcp_link)
    _check_all_named(cfg, joints, path)
    for joint in joints.values():
        _check_limits(joint, file.path)
    _check_arm(cfg, arm, path)
    check_masses(file.links, joints.values(), file.path)
    return RobotSpec(
        name=name,
        base_link=cfg.base_link,
        tcp_link=cfg.tcp_link,
        joints=tuple(replace(j, acceleration=cfg.acceleration_rad_s2, jerk=cfg.jerk_rad_s3) for j in arm),
        gripper=_gripper(cfg.gripper, joints, path),
        home_q_rad=cfg.home_q_rad,
        links=file.links,
        fixed_joints=tuple(joint for joint in file.joints if joint.kind == "fixed"),
        urdf_path=file.path,
    )


def _gripper(cfg: GripperCfg, joints: dict[str, JointSpec], path: Path) -> GripperSpec:
    fingers: list[list[tuple[JointSpec, float, float]]] = []
    for name, closed, opened in zip(cfg.joints, cfg.closed, cfg.open, strict=True):
        joint = joints[name]
        for word, value in (("closed", closed), ("open", opened)):
            if not joint.lower <= value <= joint.upper:
                raise ConfigError(
                    f"{path}: gripper.{word} puts joint '{name}' at {value}, outside its limits "
                    f"{joint.lower:g}..{joint.upper:g}."
                )
        before = next((finger for finger in fingers if finger[-1][0].child == joint.parent), None)
        if before is None and closed == opened:
            raise ConfigError(
                f"{path}: gripper.closed and gripper.open put joint '{name}' at the same place, {closed}."
            )
        if before is None:
            fingers.append([(joint, closed, opened)])
        else:
            before.append((joint, closed, opened))
    return GripperSpec(
        tuple(_finger(*zip(*finger, strict=True)) for finger in fingers),
        openings_m=(0.0, cfg.opening_m),
        tips_m=(0.0, 0.0),
        speed_mps=cfg.speed_mps,
        speed_range_mps=(0.0, cfg.speed_mps),
        force_n=cfg.force_n,
        force_range_n=(0.0, cfg.force_n),
        stiffness=cfg.stiffness,
    )


def _finger(joints: tuple[JointSpec, ...], closed: tuple[float, ...], opened: tuple[float, ...]) -> FingerSpec:
    links = tuple(joint.child for joint in reversed(joints))
    return FingerSpec(joints, closed, opened, links, pad_link=links[0])


def _check_names(what: str, given: Sequence[str], valid: Sequence[str], path: Path) -> None:
    for name in given:
        if name not in valid:
            raise ConfigError(f"{path}: {unknown_name(what, name, valid)}")


def _check_arm(cfg: RobotCfg, arm: Sequence[JointSpec], path: Path) -> None:
    way = tuple(joint.name for joint in arm)
    if way != cfg.arm_joints:
        raise ConfigError(
            f"{path}: arm_joints must be those from '{cfg.base_link}' to '{cfg.tcp_link}', in this order: "
            f"{', '.join(way)}; got {', '.join(cfg.arm_joints)}."
        )
    if len(cfg.home_q_rad) != len(way):
        raise ConfigError(
            f"{path}: home_q_rad must have {len(way)} values, one for each arm joint, got {len(cfg.home_q_rad)}."
        )
    for joint, angle in zip(arm, cfg.home_q_rad, strict=True):
        if not joint.lower <= angle <= joint.upper:
            raise ConfigError(
                f"{path}: home_q_rad puts joint '{joint.name}' at {angle}, outside its limits "
                f"{joint.lower:g}..{joint.upper:g}."
            )


def _check_all_named(cfg: RobotCfg, joints: dict[str, JointSpec], path: Path) -> None:
    for name in joints:
        if name not in (*cfg.arm_joints, *cfg.gripper.joints):
            raise ConfigError(
                f"{path}: nothing drives joint '{name}'; list it in arm_joints or gripper.joints, or make it fixed."
            )


def _check_limits(joint: JointSpec, path: Path) -> None:
    if joint.kind != "continuous" and not joint.lower < joint.upper:
        raise ConfigError(
            f"joint '{joint.name}' of '{path}' has no limits; give it a <limit> with lower < upper "
            f"(got {joint.lower:g} and {joint.upper:g})."
        )
    if joint.velocity <= 0 or joint.effort <= 0:
        raise ConfigError(
            f"joint '{joint.name}' of '{path}' has no limits; give its <limit> a positive velocity and effort "
            f"(got {joint.velocity:g} and {joint.effort:g})."
        )
