"""A guard between whoever commands and the devices: what breaks a rule is refused, everything stops, and stays so.

It knows no device, only the protocols, so the same guard stands before a simulation and before a real arm.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tr_grasp.errors import HardwareError, MotionError
from tr_grasp.hardware.command import Command, Ending
from tr_grasp.hardware.guard_cfg import GuardCfg
from tr_grasp.hardware.guarded import GuardedArm, GuardedGripper, GuardedWorld
from tr_grasp.hardware.protocols import Station
from tr_grasp.hardware.readings import ArmState, GripperState
from tr_grasp.motion import Kinematics, Trajectory
from tr_grasp.motion.arguments import Array

PATH_PERIOD_S = 0.02
"""Time between the poses of a trajectory that are held against the workspace."""
ROUNDING = 1e-3
RIPPLE = 0.1
"""Part of the speed limit by which measured speeds may exceed it."""


class Guard:
    """Wraps the devices of a station.

    A command that breaks a rule, or a state that does, trips the guard: arm and gripper are stopped, and every further
    command is refused until :meth:`reset`. States are checked before every command and, every ``check_period_s``, while
    time passes in :attr:`station`'s world.

    Args:
        station: What is guarded.
        kinematics: Of the arm.
        cfg: The rules.

    Attributes:
        station: The same devices with the guard before them; use only these.
        reason: Why it has tripped; empty while it has not.
    """

    def __init__(self, station: Station, kinematics: Kinematics, cfg: GuardCfg | None = None) -> None:
        self.cfg, self.kinematics, self.raw = cfg or GuardCfg(), kinematics, station
        own = station.arm.limits
        self.limits = replace(
            own,
            lower_rad=own.lower_rad + self.cfg.joint_margin_rad,
            upper_rad=own.upper_rad - self.cfg.joint_margin_rad,
            velocity_rad_s=own.velocity_rad_s * self.cfg.speed_share,
        )
        self.reason = ""
        self._setpoint: tuple[float, Array] | None = None
        self._outside_m = 0.0
        self._commands: list[Command] = []
        self.station = Station(
            GuardedArm(self, station.arm),
            GuardedGripper(self, station.gripper),
            GuardedWorld(self, station.world),
            station.camera,
        )

    def reset(self) -> str:
        """Let commands through again, if nothing is wrong any more; otherwise the reason, and nothing has changed."""
        before, self.reason, self._setpoint = self.reason, "", None
        self._outside_m = self._excess(self._last_pose()) if not self._unwell() else 0.0
        reason = self.check()
        self.reason = reason and before
        return reason

    def check(self) -> str:
        """Look at all states and trip if one breaks a rule; why it has tripped, empty if it has not."""
        if not self.reason and (reason := self._unwell() or self._out_of_bounds() or self._silent()):
            self.trip(reason)
        return self.reason

    def trip(self, reason: str) -> None:
        """Stop everything and refuse what comes."""
        self.reason = self.reason or reason
        self._setpoint = None
        for command in self._commands:  # before the devices end them: they would not know why
            command.end(Ending.STOPPED, self.reason)
        self._commands.clear()
        self.raw.arm.stop()
        self.raw.gripper.stop()

    # ---- commands ----------------------------------------------------------------------------------------------

    def admit(self, reason: str) -> Command | None:
        """Nothing if a command may pass; a refused handle if it or anything before breaks a rule."""
        if tripped := self.check():
            return Command.refused(f"the guard has stopped everything: {tripped}; call reset() when that is over")
        if reason:
            self.trip(reason)
            return Command.refused(reason)
        return None

    def judge_trajectory(self, trajectory: Trajectory, at_s: float | None) -> str:
        """Why a trajectory may not pass; empty if it may. One that comes too late is harmless: the arm refuses it."""
        if (dof := trajectory.dof) != self.limits.dof:
            raise MotionError(f"the trajectory must have {self.limits.dof} joints, got {dof}.")
        jump = float(np.abs(trajectory.q_rad[0] - self.raw.arm.commanded(at_s).q).max())
        if jump > self.cfg.jump_rad and not (at_s is not None and at_s < self.raw.world.now_s):
            return f"the trajectory jumps by {jump:.3g} rad at its start; {self.cfg.jump_rad:g} rad is allowed"
        if found := trajectory.violations(self.limits, margin=ROUNDING):
            return str(found[0])
        if self.cfg.workspace_m is None:
            return ""
        _, state = trajectory.every(PATH_PERIOD_S)
        excess = self._excess(self.kinematics.pose(state.q))
        # From outside, where somebody pushed it, the arm may come back in.
        if excess.max() > excess[0] + ROUNDING:
            return f"the tool would leave the workspace by {1e3 * excess.max():.0f} mm"
        return ""

    def judge_setpoint(self, q: Array, dq: Array) -> str:
        """Why a set-point may not pass; empty if it may."""
        limits, now = self.limits, self.raw.world.now_s
        if not limits.hold(q):
            return f"the set-point {np.round(q, 4).tolist()} is outside the joint limits"
        if (np.abs(dq) > limits.velocity_rad_s * (1 + ROUNDING)).any():
            return f"the set-point's speed {np.round(dq, 4).tolist()} rad/s is above the limits"
        told = self.raw.arm.commanded().q
        if (jump := float(np.abs(q - told).max())) > self.cfg.jump_rad:
            return f"the set-point jumps by {jump:.3g} rad; {self.cfg.jump_rad:g} rad is allowed"
        if self._setpoint is not None:
            then, before = self._setpoint
            way, most = np.abs(q - before), limits.velocity_rad_s * (now - then) * (1 + RIPPLE) + ROUNDING
            if (way > most).any():
                return f"the set-points ask for {way.max():.3g} rad in {now - then:.3g} s, more than the speed limits"
        ahead = np.stack([told, q, q + dq * self.raw.arm.setpoint_timeout_s])
        excess = self._excess(self.kinematics.pose(ahead)) if self.cfg.workspace_m else np.zeros(3)
        if excess[1:].max() > excess[0] + ROUNDING:
            return f"the tool would leave the workspace by {1e3 * excess.max():.0f} mm"
        return ""

    def passed(self, command: Command) -> Command:
        """Remember a command that was let through, so that it can say why it was stopped; a fault of its own trips."""
        self._commands = [other for other in self._commands if not other.done]
        if command.result is None:
            self._commands.append(command)
        elif command.result.ending is Ending.FAULT:
            self.trip(command.result.reason)
        return command

    def streamed(self, q: Array | None) -> None:
        """Remember the set-point that was let through; nothing when a stream is over."""
        self._setpoint = None if q is None else (self.raw.world.now_s, q)

    # ---- states ------------------------------------------------------------------------------------------------

    def _unwell(self) -> str:
        """Why states cannot be relied upon, or a device's own fault."""
        try:
            states: list[tuple[str, ArmState | GripperState]] = [
                ("arm", self.raw.arm.state()),
                ("gripper", self.raw.gripper.state()),
            ]
        except HardwareError as error:
            return str(error)
        for name, state in states:
            if state.fault:
                return f"the {name} reports a fault: {state.fault}"
            if (age := self.raw.world.now_s - state.stamp_s) > self.cfg.stale_after_s:
                return f"the {name}'s state is {age:.3g} s old; {self.cfg.stale_after_s:g} s is allowed"
        return ""

    def _out_of_bounds(self) -> str:
        state, told, limits = self.raw.arm.state(), self.raw.arm.commanded(), self.raw.arm.limits
        if not limits.hold(state.q_rad, tolerance_rad=0.02):
            return f"the joints are outside their limits: {np.round(state.q_rad, 3).tolist()}"
        if (np.abs(state.dq_rad_s) > self.limits.velocity_rad_s * (1 + RIPPLE) + 0.02).any():
            return f"the joints are too fast: {np.round(state.dq_rad_s, 3).tolist()} rad/s"
        if (lag := float(np.abs(state.q_rad - told.q).max())) > self.cfg.lag_rad:
            return f"a joint is {lag:.3g} rad from where it was told to be; {self.cfg.lag_rad:g} rad is allowed"
        effort = np.abs(state.effort_nm) / self._effort_limit()
        if effort.max() > 1:
            return f"joint {int(effort.argmax())} needs {np.abs(state.effort_nm)[effort.argmax()]:.3g} N m, too much"
        force, most = self.raw.gripper.state().force_n, self.grip_force_n
        if force > most * (1 + RIPPLE):
            return f"the fingers press with {force:.3g} N; {most:g} N is allowed"
        if self.cfg.workspace_m is None:
            return ""
        excess = float(self._excess(self._last_pose()))
        before, self._outside_m = self._outside_m, min(excess, self._outside_m)
        return f"the tool is {1e3 * excess:.0f} mm outside the workspace" if excess > before + 2 * ROUNDING else ""

    def _silent(self) -> str:
        if self._setpoint is None:
            return ""
        pause = self.raw.world.now_s - self._setpoint[0]
        allowed = self.cfg.watchdog_s
        return f"no set-point for {pause:.3g} s; {allowed:g} s is allowed" if pause > allowed + 1e-9 else ""

    @property
    def grip_force_n(self) -> float:
        """Strongest grip that is allowed."""
        most = self.raw.gripper.force_range_n[1]
        return most if self.cfg.grip_force_n is None else min(most, self.cfg.grip_force_n)

    def _effort_limit(self) -> Array:
        return self.kinematics.spec.effort_limit_nm * self.cfg.effort_share

    def _last_pose(self) -> Array:
        return self.kinematics.pose(self.raw.arm.state().q_rad)

    def _excess(self, T_base_tcp: Array) -> Array:
        """(*batch,) how far the tcp is outside the workspace [m]; 0 inside."""
        if self.cfg.workspace_m is None:
            return np.zeros(T_base_tcp.shape[:-2])
        low, high = (np.array(corner) for corner in self.cfg.workspace_m)
        p = T_base_tcp[..., :3, 3]
        return np.linalg.norm(np.maximum(np.maximum(low - p, p - high), 0.0), axis=-1)
