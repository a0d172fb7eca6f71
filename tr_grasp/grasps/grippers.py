"""Grippers without their arm: the hand of a robot that is data, free to move along three axes."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from tr_grasp.errors import GraspError, unknown_name
from tr_grasp.geometry import invert_transform
from tr_grasp.robots import JointSpec, LinkSpec, RobotSpec, robot_spec
from tr_grasp.robots.chain import poses_from
from tr_grasp.robots.parts import Array, Vector

_ROBOTS = {"robotiq_2f85": "ur5_robotiq_2f85", "rg2": "ur5_rg2", "panda": "panda", "kg3": "j2s7s300"}
"""Robot of whose data each gripper is a part."""

ROOT, AXES = "free_root", ("x", "y", "z")
CARRIAGE_KG = 0.2
REACH_M, SPEED_MPS, FORCE_N = 2.0, 5.0, 400.0


def gripper_names() -> tuple[str, ...]:
    """Names that :func:`floating_gripper` knows: grippers that close along the tcp's y axis, from two sides."""
    return tuple(_ROBOTS)


def gripper_of(robot: str) -> str:
    """The gripper that a robot of the package carries.

    Raises:
        GraspError: No grasps can be tried for this robot's gripper.
    """
    carried = {holder: gripper for gripper, holder in _ROBOTS.items()}
    if robot not in carried:
        raise GraspError(unknown_name("robot with a gripper for grasp sets", robot, carried))
    return carried[robot]


@cache
def floating_gripper(name: str) -> RobotSpec:
    """A hand on three straight axes along those of its tcp; with all at 0 the tcp is where the root is.

    Raises:
        GraspError: No such gripper.
    """
    if name not in _ROBOTS:
        raise GraspError(unknown_name("gripper", name, _ROBOTS))
    robot = robot_spec(_ROBOTS[name])
    fingers, hand = robot.gripper.joints, robot.gripper.joints[0].parent
    below = poses_from(hand, (*fingers, *robot.fixed_joints), {})
    T_tcp_hand = invert_transform(_pose_in(hand, robot.tcp_link, robot))
    carriages = [f"free_{axis}" for axis in AXES]
    return RobotSpec(
        name=f"floating_{name}",
        base_link=ROOT,
        tcp_link=carriages[-1],
        joints=tuple(_slide(*row) for row in zip(AXES, [ROOT, *carriages[:-1]], carriages, np.eye(3), strict=True)),
        gripper=robot.gripper,
        home_q_rad=(0.0, 0.0, 0.0),
        links=(
            *(_carriage(link) for link in (ROOT, *carriages)),
            *(_unseen(link) for link in robot.links if link.name in below and _has_body(link)),
        ),
        fixed_joints=(_mount(carriages[-1], hand, T_tcp_hand),),
    )


def gripper_links(name: str) -> tuple[LinkSpec, ...]:
    """The links of the hand as they look."""
    kept = {link.name for link in floating_gripper(name).links}
    return tuple(link for link in robot_spec(_ROBOTS[name]).links if link.name in kept)


def hand_poses(gripper: RobotSpec, openness: float) -> dict[str, Array]:
    """``T_tcp_link`` (4, 4) of the links of a floating hand, fingers on their way from closed (0) to open (1)."""
    spec = gripper.gripper
    positions = spec.closed + openness * (spec.open - spec.closed)
    return poses_from(ROOT, gripper.all_joints, dict(zip(spec.joint_names, positions, strict=True)))


def pad_centre_z_m(gripper: RobotSpec, openness: float) -> float:
    """How far the middle of the pads lies beyond the tcp, along its z; linkages move it as they open."""
    finger = gripper.gripper.fingers[0]
    T = hand_poses(gripper, openness)[finger.pad_link]
    return float((T[:3, :3] @ np.asarray(finger.pad_point_m) + T[:3, 3])[2])


def _pose_in(root: str, link: str, robot: RobotSpec) -> Array:
    """``T_root_link`` of links that do not move against each other."""
    ways = poses_from(root, robot.fixed_joints, {})
    if link in ways:
        return ways[link]
    parent = next(joint.parent for joint in robot.fixed_joints if joint.child == root)
    ways = poses_from(parent, robot.fixed_joints, {})
    return invert_transform(ways[root]) @ ways[link]


def _slide(axis: str, parent: str, child: str, direction: Array) -> JointSpec:
    x, y, z = (float(value) for value in direction)
    return JointSpec(
        f"free_{axis}_joint", parent, child, "prismatic", axis=(x, y, z), lower=-REACH_M, upper=REACH_M,
        velocity=SPEED_MPS, effort=FORCE_N,
    )  # fmt: skip


def _carriage(name: str) -> LinkSpec:
    return LinkSpec(name, CARRIAGE_KG, inertia_kgm2=(1e-3, 1e-3, 1e-3, 0.0, 0.0, 0.0))


def _unseen(link: LinkSpec) -> LinkSpec:
    # SAPIEN makes a material for whatever is drawn, which needs a graphics driver.
    return replace(link, shapes=tuple(replace(shape, drawn=False) for shape in link.shapes if shape.collides))


def _has_body(link: LinkSpec) -> bool:
    return link.mass_kg > 0


def _mount(parent: str, hand: str, T_tcp_hand: Array) -> JointSpec:
    return JointSpec("free_mount_joint", parent, hand, "fixed", _vector(T_tcp_hand[:3, 3]), _rpy(T_tcp_hand[:3, :3]))


def _rpy(R: Array) -> Vector:
    """Roll, pitch, yaw about fixed axes, as in URDF."""
    return _vector(
        np.array([np.arctan2(R[2, 1], R[2, 2]), -np.arcsin(np.clip(R[2, 0], -1, 1)), np.arctan2(R[1, 0], R[0, 0])])
    )


def _vector(values: Array) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z
