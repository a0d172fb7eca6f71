"""Devices behind a guard: they are asked as the ones that they wrap."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from tr_grasp.hardware.command import Command
from tr_grasp.hardware.protocols import Arm, Gripper, World
from tr_grasp.hardware.readings import ArmState, GripperState, PoseReading
from tr_grasp.motion import JointState, MotionLimits, Trajectory
from tr_grasp.motion.arguments import Array, joint_vector

if TYPE_CHECKING:
    from tr_grasp.hardware.guard import Guard


class GuardedArm:
    """An arm behind a guard."""

    def __init__(self, guard: Guard, arm: Arm) -> None:
        self._guard, self._arm, self.name = guard, arm, arm.name

    @property
    def limits(self) -> MotionLimits:
        """What the guard lets pass."""
        return self._guard.limits

    @property
    def setpoint_timeout_s(self) -> float:
        """For how long a set-point holds."""
        return self._arm.setpoint_timeout_s

    def state(self) -> ArmState:
        """The newest measurement."""
        return self._arm.state()

    def commanded(self, at_s: float | None = None) -> JointState:
        """What the joints are to do."""
        return self._arm.commanded(at_s)

    def move(self, trajectory: Trajectory, *, at_s: float | None = None) -> Command:
        """Follow a trajectory that keeps the rules."""
        if refused := self._guard.admit(self._guard.judge_trajectory(trajectory, at_s)):
            return refused
        command = self._arm.move(trajectory, at_s=at_s)
        return self._passed_on(command)

    def servo(self, q_rad: ArrayLike, dq_rad_s: ArrayLike) -> Command:
        """Be here now, if that keeps the rules."""
        dof = self.limits.dof
        q, dq = joint_vector("q_rad", q_rad, dof), joint_vector("dq_rad_s", dq_rad_s, dof)
        if refused := self._guard.admit(self._guard.judge_setpoint(q, dq)):
            return refused
        command = self._arm.servo(q, dq)
        return self._passed_on(command, q)

    def stop(self) -> None:
        """Come to rest."""
        self._guard.streamed(None)
        self._arm.stop()

    def _passed_on(self, command: Command, q: Array | None = None) -> Command:
        self._guard.streamed(None if command.done else q)
        return self._guard.passed(command)


class GuardedGripper:
    """A gripper behind a guard."""

    def __init__(self, guard: Guard, gripper: Gripper) -> None:
        self._guard, self._gripper = guard, gripper
        self.opening_range_m, self.speed_range_mps = gripper.opening_range_m, gripper.speed_range_mps

    @property
    def force_range_n(self) -> tuple[float, float]:
        """What the guard lets pass."""
        return self._gripper.force_range_n[0], self._guard.grip_force_n

    def state(self) -> GripperState:
        """The newest measurement."""
        return self._gripper.state()

    def move(self, opening_m: float, *, speed_mps: float | None = None, force_n: float | None = None) -> Command:
        """Open or close, if that keeps the rules."""
        most = self._guard.grip_force_n
        reason = f"force_n must be up to {most:g}, got {force_n:g}" if force_n is not None and force_n > most else ""
        if refused := self._guard.admit(reason):
            return refused
        return self._guard.passed(self._gripper.move(opening_m, speed_mps=speed_mps, force_n=force_n))

    def stop(self) -> None:
        """Stay as it is."""
        self._gripper.stop()


class GuardedWorld:
    """A world whose time passes under the eyes of a guard."""

    def __init__(self, guard: Guard, world: World) -> None:
        self._guard, self._world = guard, world

    @property
    def now_s(self) -> float:
        """The clock."""
        return self._world.now_s

    def wait(self, duration_s: float) -> None:
        """Let time pass, and look again and again."""
        self._in_slices(duration_s, self._world.wait)

    def charge(self, duration_s: float) -> None:
        """Account for time spent thinking, and look again and again."""
        self._in_slices(duration_s, self._world.charge)

    @property
    def objects(self) -> tuple[str, ...]:
        """Names of what is tracked."""
        return self._world.objects

    def poses(self, name: str, after_s: float = float("-inf")) -> tuple[PoseReading, ...]:
        """Readings that have arrived."""
        return self._world.poses(name, after_s)

    def _in_slices(self, duration_s: float, pass_on: Callable[[float], None]) -> None:
        period = self._guard.cfg.check_period_s
        whole = int(duration_s // period) if np.isfinite(duration_s) and duration_s > 0 else 0
        for _ in range(whole):
            pass_on(period)
            self._guard.check()
        pass_on(duration_s - whole * period)
        self._guard.check()
