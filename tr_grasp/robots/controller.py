"""The Cartesian controller in ManiSkill: actions to drive targets of a simulated arm and its fingers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import sapien
from gymnasium import spaces
from mani_skill.agents.controllers.base_controller import BaseController, ControllerConfig
from numpy.typing import ArrayLike, NDArray

from tr_grasp.robots.cartesian import (
    DriveGain,
    FingerDrive,
    Fingers,
    ToolLimits,
    ToolTarget,
    inverse_kinematics,
    next_target,
    pose_of,
)

Array = NDArray[np.floating]


class SapienKinematics:
    """Kinematics of a loaded articulation (SAPIEN's own Pinocchio model); the base frame is the root link's.

    Args:
        articulation: The robot.
        tcp_link: Its tcp.
        arm: (n,) which of its joints are the arm's.
    """

    def __init__(self, articulation: sapien.physx.PhysxArticulation, tcp_link: str, arm: NDArray[np.integer]) -> None:
        self._model = articulation.create_pinocchio_model()  # pyright: ignore[reportCallIssue]  # a method, not as declared
        names = [link.name for link in articulation.links]
        self._tcp = next(i for i, name in enumerate(names) if name.endswith(tcp_link))
        # A slice where it can be one: BLAS rounds differently for the copy that a list of indices makes.
        in_front = bool((arm == np.arange(len(arm))).all())
        self._arm = slice(len(arm)) if in_front else arm
        self._all = np.zeros(articulation.dof)

    def pose(self, q: Array) -> Array:
        """``T_base_tcp`` (4, 4)."""
        self._model.compute_forward_kinematics(self._joints(q))
        return self._model.get_link_pose(self._tcp).to_transformation_matrix().astype(float)

    def jacobian(self, q: Array) -> Array:
        """(6, n) in the tcp frame, linear part first."""
        return self._model.compute_single_link_local_jacobian(self._joints(q), self._tcp)[:, self._arm]

    def _joints(self, q: Array) -> Array:
        joints = self._all.copy()
        joints[self._arm] = q
        return joints


class CartesianController(BaseController):
    """Actions (dx, dy, dz, dphi, gripper) in [-1, 1] for a tool that points down.

    A step is one straight joint-space move from the commanded joints to those of the next target, with the move's
    velocity fed forward: at 4 Hz the tool ends 5 cm moves within about 1 mm, where plain position targets leave 16 mm.
    """

    config: CartesianControllerConfig
    sets_target_qpos = True
    sets_target_qvel = True

    def _initialize_action_space(self) -> None:
        self.single_action_space = spaces.Box(-1.0, 1.0, (5,), np.float32)

    def _initialize_joints(self) -> None:
        super()._initialize_joints()
        self._articulation = self.articulation._objs[0]
        active = self._articulation.active_joints
        which = self.active_joint_indices.cpu().numpy()
        self._arm_index, self._finger_index = which[: self.config.arm_dof], which[self.config.arm_dof :]
        self._arm, self._fingers = [active[i] for i in self._arm_index], [active[i] for i in self._finger_index]
        limits = self._articulation.get_qlimits()[self._arm_index].astype(float)
        self._lower, self._upper = limits[:, 0] + 0.02, limits[:, 1] - 0.02
        self.kinematics = SapienKinematics(self._articulation, self.config.tcp_link, self._arm_index)

    def set_drive_property(self) -> None:
        """Set gains and force limits of all joints."""
        gains = [*(self.config.arm_gains or [DriveGain(1e3, 1e2, 100.0)] * len(self._arm)), *self.config.fingers.gains]
        for joint, gain in zip([*self._arm, *self._fingers], gains, strict=True):
            joint.set_drive_properties(gain.stiffness, gain.damping, force_limit=gain.force_limit, mode="force")
            joint.set_friction(0.0)

    def reset(self) -> None:
        """Take the present joints as commanded, gripper open; call after the joints were set."""
        self._q = self._articulation.qpos[self._arm_index].astype(float)
        self._step_q = np.zeros_like(self._q)
        self._substep = self.config.substeps_n
        T = self.measured_pose()
        self.target = ToolTarget(T[:3, 3], _yaw_from_home(T[:3, :3], self.config.R_base_home))
        self.closing = False
        self._finger_setpoint = self.config.fingers.open_setpoint
        for joint, angle in zip(self._arm, self._q, strict=True):
            joint.set_drive_target(float(angle))
            joint.set_drive_velocity_target(0.0)
        for joint, position in zip(self._fingers, self.config.fingers.open_positions, strict=True):
            joint.set_drive_target(float(position))

    def qpos(self, arm_q: Array) -> NDArray[np.float32]:
        """All joints of the articulation, in its order, with the arm at (n,) [rad] and the gripper open."""
        q = np.zeros(self._articulation.dof, np.float32)
        q[self._arm_index], q[self._finger_index] = arm_q, self.config.fingers.open_positions
        return q

    def measured_pose(self) -> Array:
        """``T_base_tcp`` (4, 4) from the measured joints; the tcp goes with the fingertips as linkages move them."""
        T = self.kinematics.pose(self._articulation.qpos[self._arm_index].astype(float))
        T[:3, 3] += self._reach_m() * T[:3, 2]
        return T

    def gripper_opening_m(self) -> float:
        """Measured distance between the fingers."""
        return self.config.fingers.opening_m(self._articulation.qpos[self._finger_index])

    def _reach_m(self) -> float:
        return self.config.fingers.reach_m(self._articulation.qpos[self._finger_index].astype(float))

    def set_action(self, action: ArrayLike) -> None:
        """Plan the move of one policy step, (1, 5) or (5,); a NaN was refused before it came here."""
        a = np.clip(np.asarray(action, dtype=float).reshape(5), -1.0, 1.0)
        if abs(a[4]) > self.config.gripper_dead_zone:
            self.closing = bool(a[4] < 0)
        self.target = next_target(
            self.target,
            self.measured_pose()[:3, 3],
            a[:3] * self.config.translation_step_m,
            a[3] * self.config.yaw_step_rad,
            self.config.limits,
        )
        goal = pose_of(self.target, self.config.R_base_home)
        self._reach_start_m = self._reach_now_m = self._reach_m()
        goal[:3, 3] -= self._reach_start_m * goal[:3, 2]
        arrived = inverse_kinematics(self.kinematics, goal, self._q, self._lower, self._upper, rest=self.config.rest_q)
        self._step_q = (arrived - self._q) / self.config.substeps_n
        self._start_q, self._q, self._substep = self._q, arrived, 0
        self._retreat: Array | None = None

    def before_simulation_step(self) -> None:
        """Send the drives their next targets."""
        self._drive_fingers()
        if self._substep >= self.config.substeps_n:
            return
        self._substep += 1
        last = self._substep == self.config.substeps_n
        q = self._start_q + self._step_q * self._substep
        velocity = np.zeros_like(q) if last else self._step_q / self.config.timestep_s
        q, velocity = self._with_retreat(q, velocity)
        if last and self._reach_now_m != self._reach_start_m:
            self._q = np.clip(q, self._lower, self._upper)
        self._drive_arm(q, velocity)

    def _drive_arm(self, q: Array, velocity: Array) -> None:
        for joint, angle, speed in zip(self._arm, q, velocity, strict=True):
            joint.set_drive_target(float(angle))
            joint.set_drive_velocity_target(float(speed))

    def _with_retreat(self, q: Array, velocity: Array) -> tuple[Array, Array]:
        """Joints (n,) and their speeds with what keeps the fingertips where they are while the fingers move."""
        before, self._reach_now_m = self._reach_now_m, self._reach_m()
        if self._reach_now_m == self._reach_start_m:
            return q, velocity
        retreat = self._retreat_per_metre()
        return (
            q + (self._reach_now_m - self._reach_start_m) * retreat,
            velocity + (self._reach_now_m - before) / self.config.timestep_s * retreat,
        )

    def _retreat_per_metre(self) -> Array:
        """(n,) joint motion that takes the hand back along its z by a metre, so that fingers that reach out stay."""
        retreat = self._retreat
        if retreat is None:
            J = self.kinematics.jacobian(self._q)
            retreat = self._retreat = -J.T @ np.linalg.solve(J @ J.T + 1e-5 * np.eye(6), np.eye(6)[2])
        return retreat

    def _drive_fingers(self) -> None:
        fingers = self._articulation.qpos[self._finger_index].astype(float)
        self._finger_setpoint, targets = self.config.fingers.targets(
            self._finger_setpoint, self.closing, fingers, self.config.timestep_s
        )
        for joint, target in zip(self._fingers, targets, strict=True):
            joint.set_drive_target(float(target))


def _yaw_from_home(R_base_tcp: Array, R_base_home: Array) -> float:
    R = R_base_tcp @ R_base_home.T
    return float(np.arctan2(R[1, 0], R[0, 0]))


@dataclass
class CartesianControllerConfig(ControllerConfig):
    """Settings of :class:`CartesianController`.

    ``joint_names`` lists the arm, then the fingers; without ``arm_gains`` the arm has the Panda's. An arm
    with more than six joints leans towards ``rest_q`` (n,) [rad].
    """

    substeps_n: int = 25
    timestep_s: float = 0.01
    tcp_link: str = ""
    arm_dof: int = 7
    R_base_home: Array = field(default_factory=lambda: np.diag([1.0, -1.0, -1.0]))
    translation_step_m: float = 0.05
    yaw_step_rad: float = 0.4
    gripper_dead_zone: float = 0.0
    limits: ToolLimits = field(default_factory=lambda: ToolLimits(np.full(3, -1.0), np.full(3, 1.0)))
    fingers: Fingers = field(default_factory=FingerDrive)
    arm_gains: Sequence[DriveGain] = ()
    rest_q: Array | None = None
    controller_cls = CartesianController
