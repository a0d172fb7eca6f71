"""Fingers without physics."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tr_grasp.errors import HardwareError
from tr_grasp.hardware.command import Command, Ending
from tr_grasp.hardware.faults import FaultScript
from tr_grasp.hardware.fingers import FingerGoal, finger_goal
from tr_grasp.hardware.readings import GripperState
from tr_grasp.robots.parts import GripperSpec

THERE_M = 1e-9


class FakeGripper:
    """Fingers that move at exactly the speed asked for.

    Args:
        gripper: Its ranges.
        on_tick: Registers a function of the tick's length [s].
        faults: What goes wrong.
        blocked_at_m: Width of an object between them; may be set at any time.
    """

    def __init__(
        self,
        gripper: GripperSpec,
        on_tick: Callable[[Callable[[float], None]], None],
        faults: FaultScript,
        blocked_at_m: float | None = None,
    ) -> None:
        self.opening_range_m, self.speed_range_mps = gripper.opening_range_m, gripper.speed_range_mps
        self.force_range_n, self.blocked_at_m = gripper.force_range_n, blocked_at_m
        self._spec, self._faults = gripper, faults
        self._opening_m, self._holding = gripper.opening_range_m[1], False
        self._goal = FingerGoal(self._opening_m, gripper.speed_range_mps[1], gripper.force_n)
        self._command: Command | None = None
        self._seen = self._measure()
        on_tick(self._tick)

    def state(self) -> GripperState:
        """The newest measurement."""
        if self._faults.holds("disconnected"):
            raise HardwareError("the gripper is not connected.")
        return self._seen

    def move(self, opening_m: float, *, speed_mps: float | None = None, force_n: float | None = None) -> Command:
        """Open or close."""
        goal = finger_goal(self._spec, opening_m, speed_mps, force_n)
        if isinstance(goal, str):
            return Command.refused(goal)
        if reason := self._faults.reason:
            return Command.ended(Ending.FAULT, reason)
        self._end(Ending.SUPERSEDED)
        self._goal, self._command = goal, Command(lambda _: self._stay(Ending.CANCELLED))
        self._begun_m = self._opening_m
        return self._command

    def stop(self) -> None:
        """Stay."""
        self._stay(Ending.STOPPED)

    def _stay(self, ending: Ending, detail: str = "") -> None:
        self._end(ending, detail)
        if not self._holding:
            self._goal = self._goal._replace(opening_m=self._opening_m)

    def _end(self, ending: Ending, detail: str = "") -> None:
        if self._command is not None:
            self._command.end(ending, detail)
            self._command = None

    def _tick(self, dt_s: float) -> None:
        if reason := self._faults.reason:
            self._stay(Ending.FAULT, reason)
        goal, step = self._goal, self._goal.speed_mps * dt_s
        wanted = self._opening_m + float(np.clip(goal.opening_m - self._opening_m, -step, step))
        stop_m = self.blocked_at_m
        closing = goal.opening_m < self._opening_m - THERE_M
        self._holding = stop_m is not None and wanted <= stop_m <= self._opening_m and goal.opening_m < stop_m
        self._opening_m = stop_m if self._holding and stop_m is not None and closing else wanted
        if self._command is not None:
            way = abs(goal.opening_m - self._begun_m)
            self._command.progress = 1.0 if way == 0 else 1 - abs(goal.opening_m - self._opening_m) / way
            if self._holding:
                self._end(Ending.HOLDING, f"at {1e3 * self._opening_m:.1f} mm")
            elif abs(goal.opening_m - self._opening_m) < THERE_M:
                self._end(Ending.DONE)
        if self._faults.stamp_s > self._seen.stamp_s or self._seen.fault != self._faults.reason:
            self._seen = self._measure()

    def _measure(self) -> GripperState:
        return GripperState(
            stamp_s=self._faults.stamp_s,
            opening_m=self._opening_m,
            force_n=self._goal.force_n if self._holding else 0.0,
            moving=self._command is not None,
            holding=self._holding,
            fault=self._faults.reason,
        )
