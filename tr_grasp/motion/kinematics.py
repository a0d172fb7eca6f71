"""Where the tool of an arm is, how it moves with the joints, and how near joints are to their limits (Pinocchio)."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from tr_grasp.errors import MotionError
from tr_grasp.motion.arguments import Array, joint_vector, one_of
from tr_grasp.motion.chain import Chain
from tr_grasp.robots.spec import RobotSpec, urdf_text


class Kinematics:
    """An arm with locked fingers.

    Poses are ``T_base_tcp``, joint angles (*batch, dof) in the order of ``spec.joint_names``.

    Args:
        spec: The robot.
        opening_m: How far the fingers are open; fully, if not given.

    Attributes:
        model: Pinocchio's model, arm joints only.

    Raises:
        MotionError: A joint of the arm does not turn, or is missing in the robot's URDF.
    """

    def __init__(self, spec: RobotSpec, opening_m: float | None = None) -> None:
        self.spec = spec
        self.lower_rad, self.upper_rad = spec.lower_rad, spec.upper_rad
        self.home_q_rad = np.array(spec.home_q_rad, float)
        self.urdf = urdf_text(_with_plain_joints(spec))
        self.full_model = pin.buildModelFromXML(self.urdf)
        gripper = spec.gripper
        fingers = gripper.open if opening_m is None else gripper.joint_positions(opening_m)
        self.full_q = pin.neutral(self.full_model)
        for name, position in zip(gripper.joint_names, fingers, strict=True):
            self.full_q[self.full_model.joints[self.full_model.getJointId(name)].idx_q] = position
        self.locked = [i for i, name in enumerate(self.full_model.names) if i and name not in spec.joint_names]
        self.model = pin.buildReducedModel(self.full_model, self.locked, self.full_q)
        names = tuple(self.model.names)[1:]
        if names != spec.joint_names or self.model.nq != len(names):
            raise MotionError(
                f"the arm joints of {spec.name!r} must be revolute and in one row, in order; "
                f"its URDF gives {', '.join(names)}."
            )
        self._data = self.model.createData()
        self._tcp = self._frame(spec.tcp_link)

    @property
    def dof(self) -> int:
        """Number of arm joints."""
        return self.model.nq

    @cached_property
    def chain(self) -> Chain:
        """The same kinematics for many joint vectors at once."""
        zero = np.zeros(self.dof)
        pin.computeJointJacobians(self.model, self._data, zero)
        axes = [
            pin.getJointJacobian(self.model, self._data, i + 1, pin.ReferenceFrame.LOCAL)[3:, i]
            for i in range(self.dof)
        ]
        placements = [self.model.jointPlacements[i + 1].homogeneous for i in range(self.dof)]
        tcp = self.model.frames[self._tcp].placement.homogeneous
        T_base = self._base_placement()
        return Chain.from_axes(np.array([T_base @ placements[0], *placements[1:]]), np.array(axes), tcp)

    def pose(self, q: ArrayLike) -> Array:
        """``T_base_tcp`` (*batch, 4, 4)."""
        q = self._joints(q)
        return self.chain.pose(q.reshape(-1, self.dof)).reshape(*q.shape[:-1], 4, 4)

    def link_pose(self, q: ArrayLike, link: str) -> Array:
        """``T_base_link`` (4, 4) of any link, at joints (dof,).

        Raises:
            MotionError: No such link.
        """
        pin.framesForwardKinematics(self.model, self._data, joint_vector("q", q, self.dof))
        return self._base_placement() @ self._data.oMf[self._frame(link)].homogeneous

    def jacobian(self, q: ArrayLike) -> Array:
        """(*batch, 6, dof): linear [m/rad] over angular [rad/rad] velocity of the tcp, in base axes."""
        q = self._joints(q)
        _, J = self.chain.pose_and_jacobian(q.reshape(-1, self.dof))
        return J.reshape(*q.shape[:-1], 6, self.dof)

    def tcp_velocity(self, q: ArrayLike, dq: ArrayLike) -> Array:
        """(*batch, 6): linear [m/s] over angular [rad/s], in base axes, at joint speeds (*batch, dof)."""
        return (self.jacobian(q) @ self._joints(dq)[..., None])[..., 0]

    def manipulability(self, q: ArrayLike) -> Array:
        """(*batch,) Yoshikawa's measure, the volume of tool velocities that unit joint speeds give; 0 is singular."""
        J = self.jacobian(q)
        return np.sqrt(np.maximum(np.linalg.det(J @ J.swapaxes(-1, -2)), 0.0))

    def limit_distance_rad(self, q: ArrayLike) -> Array:
        """(*batch,) distance of the joint that is nearest to one of its limits; negative outside."""
        q = self._joints(q)
        return np.minimum(q - self.lower_rad, self.upper_rad - q).min(-1)

    def joint_positions(self, q: ArrayLike) -> Array:
        """(m, 3) [m] in the base frame: base, every joint, tcp; the arm as a stick figure. Joints are (dof,)."""
        pin.forwardKinematics(self.model, self._data, joint_vector("q", q, self.dof))
        T_base = self._base_placement()
        joints = [T_base @ self._data.oMi[i + 1].homogeneous for i in range(self.dof)]
        return np.array([np.zeros(3), *(T[:3, 3] for T in joints), self.pose(q)[:3, 3]])

    def _base_placement(self) -> Array:
        """Transform from Pinocchio's world to the base link: where its URDF root is another link than ``base_link``."""
        frame = self.model.frames[self._frame(self.spec.base_link)]
        return frame.placement.inverse().homogeneous

    def _frame(self, link: str) -> int:
        names = [frame.name for frame in self.model.frames if frame.type == pin.FrameType.BODY]
        one_of("link", link, names)
        return self.model.getFrameId(link, pin.FrameType.BODY)

    def _joints(self, q: ArrayLike) -> Array:
        q = np.asarray(q, float)
        if q.ndim == 0 or q.shape[-1] != self.dof:
            raise MotionError(f"q must hold {self.dof} joints in its last axis, got an array of shape {q.shape}.")
        if not np.isfinite(q).all():
            raise MotionError("q must be finite, got NaN or infinity.")
        return q


def _with_plain_joints(spec: RobotSpec) -> RobotSpec:
    """The robot with limits on all joints: Pinocchio stores ``continuous`` ones as cosine and sine."""
    plain = tuple(replace(joint, kind="revolute") if joint.kind == "continuous" else joint for joint in spec.joints)
    return replace(spec, joints=plain)
