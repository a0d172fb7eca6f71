"""A simulated arm behind the hardware protocol: joint drives with feed-forward."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import sapien
from numpy.typing import ArrayLike, NDArray

from tr_grasp.hardware import ArmState, Command, Follower
from tr_grasp.motion import JointState, MotionLimits, Trajectory
from tr_grasp.motion.arguments import Array, joint_vector
from tr_grasp.robots.spec import RobotSpec


class SapienArm:
    """Drives follow the commanded joints; their speed and the torques that the motion takes are fed forward.

    The links have no weight (as in Task I): real arms compensate for their own.

    Args:
        spec: The robot.
        articulation: It, in a scene; its drives have their gains.
        which: (dof,) which of its joints are the arm's.
        clock: Gives the world's time.
        timestep_s: Of the physics.
    """

    def __init__(
        self,
        spec: RobotSpec,
        articulation: sapien.physx.PhysxArticulation,
        which: NDArray[np.integer],
        clock: Callable[[], float],
        timestep_s: float,
    ) -> None:
        self.name, self.limits = spec.name, MotionLimits.of(spec)
        self._articulation, self._which, self._clock, self._timestep_s = articulation, which, clock, timestep_s
        self._joints = [articulation.active_joints[i] for i in which]
        self._stiffness = np.array([joint.stiffness for joint in self._joints])
        self._damping = np.array([joint.damping for joint in self._joints])
        self._dynamics = articulation.create_pinocchio_model()
        self._follower = Follower(self.limits, spec.home_q_rad, clock)
        self._told = self._follower.commanded()
        self._feed = np.zeros(articulation.dof)

    @property
    def setpoint_timeout_s(self) -> float:
        """For how long a set-point holds."""
        return self._follower.setpoint_timeout_s

    def state(self) -> ArmState:
        """Joints as they are now; torques of the drives."""
        q, dq = self._measured()
        effort = self._stiffness * (self._told.q - q) + self._damping * (self._told.dq - dq) + self._feed[self._which]
        return ArmState(self._clock(), q, dq, effort)

    def commanded(self, at_s: float | None = None) -> JointState:
        """What the joints are to do."""
        return self._follower.commanded(at_s)

    def move(self, trajectory: Trajectory, *, at_s: float | None = None) -> Command:
        """Follow a trajectory."""
        return self._follower.move(trajectory, at_s)

    def servo(self, q_rad: ArrayLike, dq_rad_s: ArrayLike) -> Command:
        """Be here now."""
        return self._follower.servo(q_rad, dq_rad_s)

    def stop(self) -> None:
        """Come to rest."""
        self._follower.stop()

    def place(self, q_rad: ArrayLike) -> None:
        """Put the joints (dof,) somewhere else at once, at rest: for set-ups, no arm can do that."""
        q = joint_vector("q_rad", q_rad, self.limits.dof)
        everything = self._articulation.qpos
        everything[self._which] = q
        self._articulation.set_qpos(everything)
        self._articulation.set_qvel(np.zeros_like(everything))
        self._follower.stop()
        self._follower.rest_at(q)
        self._send(self._follower.commanded())

    def before_step(self) -> None:
        """Tell the drives where to be at the end of the step."""
        self._follower.advance()
        self._send(self._follower.commanded(self._clock() + self._timestep_s))

    def _send(self, told: JointState) -> None:
        self._told = told
        for joint, q, dq in zip(self._joints, told.q, told.dq, strict=True):
            joint.set_drive_target(float(q))
            joint.set_drive_velocity_target(float(dq))
        acceleration, self._feed = np.zeros((2, self._articulation.dof))
        acceleration[self._which] = told.ddq
        if told.ddq.any() or told.dq.any():
            mass = self._dynamics.compute_generalized_mass_matrix(self._articulation.qpos)
            turning = self._articulation.compute_passive_force(gravity=False, coriolis_and_centrifugal=True)
            self._feed[self._which] = (mass @ acceleration + turning)[self._which]
        self._articulation.set_qf(self._feed)

    def _measured(self) -> tuple[Array, Array]:
        return self._articulation.qpos[self._which].astype(float), self._articulation.qvel[self._which].astype(float)
