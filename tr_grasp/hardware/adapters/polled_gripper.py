"""Grippers that are given a goal and asked again and again how far they are: what is the same for all of them."""

from __future__ import annotations

import threading
from typing import Protocol

import numpy as np

from tr_grasp.errors import HardwareError
from tr_grasp.hardware.command import Command, Ending
from tr_grasp.hardware.fingers import FingerGoal, finger_goal
from tr_grasp.hardware.readings import GripperState
from tr_grasp.hardware.real_world import Beats
from tr_grasp.robots.parts import GripperSpec

NEAR_M = 2e-3
"""Fingers that have stopped this near to the goal have arrived."""


class FingerLink(Protocol):
    """A gripper in its own language."""

    @property
    def rate_hz(self) -> float:
        """How often it is asked."""
        ...

    @property
    def knows_speed(self) -> bool:
        """It moves as fast as it is told; one that does not is led by goals that move on at the speed."""
        ...

    def read(self) -> GripperState:
        """The newest state; ``moving`` from the moment of :meth:`go`.

        Raises:
            HardwareError: Not connected.
        """
        ...

    def go(self, goal: FingerGoal) -> None:
        """Start a motion, and return at once.

        Raises:
            HardwareError: It does not take it.
        """
        ...

    def halt(self) -> None:
        """Stay as it is; never fails."""
        ...

    def close(self) -> None:
        """Let go of it."""
        ...


class PolledGripper:
    """A gripper behind a link.

    Args:
        spec: Its ranges.
        link: To it.
        clock: Of its world.

    Raises:
        HardwareError: It cannot be asked.
    """

    def __init__(self, spec: GripperSpec, link: FingerLink, clock: Beats) -> None:
        self.opening_range_m, self.speed_range_mps = spec.opening_range_m, spec.speed_range_mps
        self.force_range_n = spec.force_range_n
        self._spec, self._link, self._clock = spec, link, clock
        self._period_s, self._lock = 1.0 / link.rate_hz, threading.RLock()
        self._command: Command | None = None
        self._goal: FingerGoal | None = None
        self._seen, self._lost = link.read(), ""
        self._begun_m = self._led_m = self._seen.opening_m
        self._end_beats = clock.every(self._period_s, self._beat)

    def state(self) -> GripperState:
        """The newest measurement."""
        if self._lost:
            raise HardwareError(self._lost)
        return self._seen

    def move(self, opening_m: float, *, speed_mps: float | None = None, force_n: float | None = None) -> Command:
        """Open or close."""
        goal = finger_goal(self._spec, opening_m, speed_mps, force_n)
        if isinstance(goal, str):
            return Command.refused(goal)
        with self._lock:
            if trouble := self._lost or self._seen.fault:
                return Command.ended(Ending.FAULT, trouble)
            self._end(Ending.SUPERSEDED)
            self._begun_m = self._led_m = self._seen.opening_m
            self._goal, self._command = goal, Command(lambda _: self._stay(Ending.CANCELLED))
            command = self._command
            try:
                self._lead()
            except HardwareError as error:
                self._stay(Ending.FAULT, str(error))
            return command

    def stop(self) -> None:
        """Stay as it is; a grip is kept."""
        self._stay(Ending.STOPPED)

    def close(self) -> None:
        """Stop and let go of it."""
        self._end_beats()
        self.stop()
        self._link.close()

    def _beat(self) -> None:
        with self._lock:
            try:
                self._seen, self._lost = self._link.read(), ""
                if not self._seen.fault and self._command is not None and not self._led:
                    self._lead()
            except HardwareError as error:
                self._lost = str(error)
            if trouble := self._lost or self._seen.fault:
                if self._command is not None:
                    self._stay(Ending.FAULT, trouble)
            elif self._command is not None:
                self._judge(self._command, self._seen)

    @property
    def _led(self) -> bool:
        return self._goal is None or self._led_m == self._goal.opening_m

    def _lead(self) -> None:
        """Give the link its goal, or the next step towards it."""
        goal = self._goal
        if goal is None:
            return
        step = float("inf") if self._link.knows_speed else goal.speed_mps * self._period_s
        self._led_m += float(np.clip(goal.opening_m - self._led_m, -step, step))
        self._link.go(goal._replace(opening_m=self._led_m))

    def _judge(self, command: Command, seen: GripperState) -> None:
        if self._goal is None:
            return
        way, gap = abs(self._goal.opening_m - self._begun_m), abs(self._goal.opening_m - seen.opening_m)
        command.progress = max(command.progress, float(np.clip(1 - gap / way, 0.0, 1.0))) if way > 0 else 0.0
        if seen.holding:
            self._end(Ending.HOLDING, f"at {1e3 * seen.opening_m:.1f} mm")
        elif not seen.moving and self._led:
            arrived = gap < NEAR_M
            detail = "" if arrived else f"the fingers stopped at {1e3 * seen.opening_m:.1f} mm"
            self._end(Ending.DONE if arrived else Ending.FAULT, detail)

    def _stay(self, ending: Ending, detail: str = "") -> None:
        with self._lock:
            self._end(ending, detail)
            if not self._seen.holding or ending is Ending.FAULT:
                self._link.halt()

    def _end(self, ending: Ending, detail: str = "") -> None:
        if self._command is not None:
            self._command.end(ending, detail)
        self._command = self._goal = None
