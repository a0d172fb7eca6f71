"""Forward kinematics of a robot that is data: where every link is, in numpy."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import ArrayLike

from tr_grasp.robots.parts import Array, JointSpec
from tr_grasp.robots.spec import RobotSpec


def origin_transform(xyz_m: ArrayLike, rpy_rad: ArrayLike) -> Array:
    """``T_parent_child`` (4, 4) of a URDF origin: roll, pitch, yaw about the parent's fixed axes x, y, z."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy_rad), np.sin(rpy_rad)
    T = np.eye(4)
    T[:3, :3] = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    T[:3, 3] = xyz_m
    return T


def joint_transform(joint: JointSpec, position: float = 0.0) -> Array:
    """``T_parent_child`` (4, 4) of a joint at a position [rad or m]."""
    T = origin_transform(joint.xyz_m, joint.rpy_rad)
    axis = np.asarray(joint.axis)
    if joint.kind == "prismatic":
        T[:3, 3] += T[:3, :3] @ (position * axis)
    elif joint.kind != "fixed":
        T[:3, :3] = T[:3, :3] @ rotation_about(axis, position)
    return T


def rotation_about(axis: Array, angle_rad: float) -> Array:
    """``R`` (3, 3) about a unit axis (3,) (Rodrigues)."""
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle_rad) * K + (1 - np.cos(angle_rad)) * (K @ K)


def link_poses(spec: RobotSpec, q_arm: ArrayLike, fingers: ArrayLike | None = None) -> dict[str, Array]:
    """``T_base_link`` (4, 4) of every link.

    Args:
        spec: The robot.
        q_arm: (n,) arm joints [rad].
        fingers: Finger joints as in :attr:`GripperSpec.joints`; open if not given.
    """
    fingers = spec.gripper.open if fingers is None else np.asarray(fingers)
    position = dict(zip(spec.joint_names, np.asarray(q_arm), strict=True))
    position |= dict(zip(spec.gripper.joint_names, fingers, strict=True))
    return poses_from(spec.base_link, spec.all_joints, position)


def poses_from(root: str, joints: Iterable[JointSpec], position: Mapping[str, float]) -> dict[str, Array]:
    """``T_root_link`` (4, 4) of every link that joints lead to from ``root``; joints without a position are at 0."""
    children: dict[str, list[JointSpec]] = {}
    for joint in joints:
        children.setdefault(joint.parent, []).append(joint)
    poses: dict[str, Array] = {root: np.eye(4)}
    todo = [root]
    while todo:
        parent = todo.pop()
        for joint in children.get(parent, ()):
            poses[joint.child] = poses[parent] @ joint_transform(joint, position.get(joint.name, 0.0))
            todo.append(joint.child)
    return poses


class ChainKinematics:
    """Kinematics of the arm without a simulator; the tcp is fixed to the hand."""

    def __init__(self, spec: RobotSpec) -> None:
        self._joints = spec.joints
        self._axes = [np.asarray(joint.axis) for joint in spec.joints]
        fixed = poses_from(spec.joints[-1].child, spec.fixed_joints, {})
        self._T_tip_tcp = fixed[spec.tcp_link]
        lead = poses_from(spec.base_link, spec.fixed_joints, {})
        self._T_base_first = lead[spec.joints[0].parent]

    def pose(self, q: Array) -> Array:
        """``T_base_tcp`` (4, 4)."""
        return self._frames(q)[-1]

    def jacobian(self, q: Array) -> Array:
        """(6, n) in the tcp frame, linear part first."""
        *frames, T = self._frames(q)
        axes = np.stack([frame[:3, :3] @ axis for frame, axis in zip(frames, self._axes, strict=True)])
        arms = T[:3, 3] - np.stack([frame[:3, 3] for frame in frames])
        R = T[:3, :3]
        return np.concatenate([R.T @ np.cross(axes, arms).T, R.T @ axes.T])

    def _frames(self, q: Array) -> list[Array]:
        """``T_base_child`` of every joint, then of the tcp."""
        frames, T = [], self._T_base_first
        for joint, angle in zip(self._joints, q, strict=True):
            T = T @ joint_transform(joint, angle)
            frames.append(T)
        return [*frames, T @ self._T_tip_tcp]
