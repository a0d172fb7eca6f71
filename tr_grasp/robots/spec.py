"""An arm with its gripper as plain data, and the arms that come with the package, by name."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path

import numpy as np

from tr_grasp.errors import ConfigError, unknown_name
from tr_grasp.robots.parts import Array, DhTable, FingerSpec, GripperSpec, JointSpec, LinkSpec, Shape
from tr_grasp.robots.urdf import urdf_text, write_urdf

__all__ = [
    "DhTable",
    "FingerSpec",
    "GripperSpec",
    "JointSpec",
    "LinkSpec",
    "RobotSpec",
    "Shape",
    "robot_names",
    "robot_spec",
    "urdf_text",
    "write_urdf",
]

_MODULES = {"panda": "panda", "ur5_rg2": "ur5", "ur5_robotiq_2f85": "ur5", "j2s7s300": "j2s7s300"}
"""Module of this package in which a function of the robot's name makes it."""


@dataclass(frozen=True)
class RobotSpec:
    """An arm and its gripper.

    The tcp frame lies between the closed fingertips: z points out of the hand, and the fingers close along y.

    Attributes:
        name: Its name in ``robot_uids`` and in the URDF.
        base_link: Link that stands still.
        tcp_link: Frame between the fingertips.
        joints: Of the arm, base to tip.
        gripper: The fingers.
        home_q_rad: Arm joints at which the tool points down and the open gripper is at (0.5, 0, 0.24) m in the base
            frame: the tcp link, less what :meth:`GripperSpec.tips_beyond_tcp_m` says the open fingertips retract.
        links: All links, frames included.
        fixed_joints: What holds links together that do not move against each other.
        dh: Published kinematics, where there are any.
        urdf_path: File that this was read from; the others are written by :func:`urdf_text`.
    """

    name: str
    base_link: str
    tcp_link: str
    joints: tuple[JointSpec, ...]
    gripper: GripperSpec
    home_q_rad: tuple[float, ...]
    links: tuple[LinkSpec, ...]
    fixed_joints: tuple[JointSpec, ...]
    dh: DhTable | None = None
    urdf_path: Path | None = None

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Arm joints, base to tip."""
        return tuple(joint.name for joint in self.joints)

    @property
    def lower_rad(self) -> Array:
        """(n,) lower limits of the arm joints."""
        return np.array([joint.lower for joint in self.joints])

    @property
    def upper_rad(self) -> Array:
        """(n,) upper limits of the arm joints."""
        return np.array([joint.upper for joint in self.joints])

    @property
    def velocity_limit_rad_s(self) -> Array:
        """(n,) largest speeds of the arm joints."""
        return np.array([joint.velocity for joint in self.joints])

    @property
    def acceleration_limit_rad_s2(self) -> Array:
        """(n,) largest accelerations of the arm joints."""
        return np.array([joint.acceleration for joint in self.joints])

    @property
    def jerk_limit_rad_s3(self) -> Array:
        """(n,) largest jerks of the arm joints."""
        return np.array([joint.jerk for joint in self.joints])

    @property
    def effort_limit_nm(self) -> Array:
        """(n,) largest torques of the arm joints."""
        return np.array([joint.effort for joint in self.joints])

    @property
    def all_joints(self) -> tuple[JointSpec, ...]:
        """Joints of the arm, of the fingers, and fixed ones."""
        return (*self.joints, *self.gripper.joints, *self.fixed_joints)


def robot_names() -> tuple[str, ...]:
    """Names that :func:`robot_spec` knows."""
    return tuple(_MODULES)


def robot_spec(name: str) -> RobotSpec:
    """A robot that comes with the package, or one of your own.

    Args:
        name: ``panda``, ``ur5_rg2``, ``ur5_robotiq_2f85`` or ``j2s7s300``; or the path of a YAML file for
            :func:`tr_grasp.robots.load_robot`.

    Raises:
        ConfigError: No such robot, or a file that :func:`~tr_grasp.robots.load_robot` refuses.
    """
    if Path(name).suffix in (".yaml", ".yml"):
        return import_module("tr_grasp.robots.user").load_robot(name)
    if name not in _MODULES:
        raise ConfigError(f"{unknown_name('robot', name, _MODULES)} The path of a YAML file works too.")
    return _own(name)


@cache
def _own(name: str) -> RobotSpec:
    return getattr(import_module(f"tr_grasp.robots.{_MODULES[name]}"), name)()
