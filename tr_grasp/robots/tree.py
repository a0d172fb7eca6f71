"""Which joints of a URDF are the arm's."""

from __future__ import annotations

from dataclasses import replace

from tr_grasp.errors import ConfigError
from tr_grasp.robots.parts import JointSpec
from tr_grasp.robots.urdf_reader import UrdfFile


def arm_between(file: UrdfFile, base_link: str, end_link: str) -> tuple[JointSpec, ...]:
    """Moving joints on the way from one link to another, base to tip.

    Raises:
        ConfigError: There is no such way.
    """
    above = {joint.child: joint for joint in file.joints}
    way, link = [], end_link
    while link != base_link:
        if link not in above:
            raise ConfigError(f"no joints lead from link '{base_link}' to link '{end_link}' in '{file.path}'.")
        way.append(above[link])
        link = above[link].parent
    return tuple(joint for joint in reversed(way) if joint.kind != "fixed")


def with_dynamics(joint: JointSpec, acceleration: float, jerk: float) -> JointSpec:
    """The joint with limits that URDF has no place for."""
    return replace(joint, acceleration=acceleration, jerk=jerk)
