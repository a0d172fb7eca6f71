"""Simulated fingers behind the hardware protocol."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import sapien
from numpy.typing import NDArray

from tr_grasp.hardware import Command, Ending, GripperState
from tr_grasp.hardware.fingers import FingerGoal, finger_goal
from tr_grasp.robots.fingers import CoupledFingers
from tr_grasp.robots.parts import GripperSpec

STILL_M, STILL_S = 2e-4, 0.15
"""Fingers that have moved less than this for so long stand still."""
THERE_M, NEAR_M = 3e-4, 1.5e-3
"""Close enough to the goal while moving, and after the fingers have stopped."""


class SapienGripper:
    """Fingers coupled by their drives; which press on whatever stops them.

    Args:
        gripper: The fingers.
        articulation: The robot, in a scene.
        which: (joints,) which of its joints are the fingers'.
        clock: Gives the world's time.
        timestep_s: Of the physics.
    """

    def __init__(
        self,
        gripper: GripperSpec,
        articulation: sapien.physx.PhysxArticulation,
        which: NDArray[np.integer],
        clock: Callable[[], float],
        timestep_s: float,
    ) -> None:
        self.opening_range_m, self.speed_range_mps = gripper.opening_range_m, gripper.speed_range_mps
        self.force_range_n = gripper.force_range_n
        self._spec, self._articulation, self._which = gripper, articulation, which
        self._clock, self._timestep_s = clock, timestep_s
        self._joints = [articulation.active_joints[i] for i in which]
        self._fingers, self._setpoint = CoupledFingers.of(gripper), 1.0
        self._goal = FingerGoal(gripper.opening_range_m[1], gripper.speed_range_mps[1], gripper.force_n)
        self._closing, self._holding = False, False
        self._command: Command | None = None
        self._mark_m, self._mark_s = gripper.opening_range_m[1], 0.0

    def state(self) -> GripperState:
        """Fingers as they are now."""
        force = self._goal.force_n if self._holding else 0.0
        return GripperState(self._clock(), self._opening_m(), force, self._command is not None, self._holding)

    def move(self, opening_m: float, *, speed_mps: float | None = None, force_n: float | None = None) -> Command:
        """Open or close."""
        goal = finger_goal(self._spec, opening_m, speed_mps, force_n)
        if isinstance(goal, str):
            return Command.refused(goal)
        self._end(Ending.SUPERSEDED)
        self._command = Command(lambda _: self._stay(Ending.CANCELLED))
        self._fingers = replace(self._fingers, speed_mps=goal.speed_mps, force_n=goal.force_n)
        self._goal, self._begun_m = goal, self._opening_m()
        self._closing = goal.opening_m < self._begun_m
        self._holding, self._mark_m, self._mark_s = False, self._begun_m, self._clock()
        return self._command

    def stop(self) -> None:
        """Stay as it is."""
        self._stay(Ending.STOPPED)

    def before_step(self) -> None:
        """Tell the drives where to be at the end of the step."""
        fingers = self._articulation.qpos[self._which].astype(float)
        goal = self._spec.openness(self._goal.opening_m)
        self._setpoint, targets = self._fingers.targets(
            self._setpoint, self._closing, fingers, self._timestep_s, goal=goal
        )
        for joint, target in zip(self._joints, targets, strict=True):
            joint.set_drive_target(float(target))
        self._judge(self._spec.opening_m(fingers))

    def _judge(self, opening_m: float) -> None:
        """Say whether the fingers have arrived, or what has stopped them."""
        now, goal = self._clock(), self._goal.opening_m
        if abs(opening_m - self._mark_m) > STILL_M:
            self._mark_m, self._mark_s = opening_m, now
        still, gap = now - self._mark_s > STILL_S, abs(opening_m - goal)
        self._holding = still and self._closing and gap > NEAR_M
        if self._command is None:
            return
        way = abs(goal - self._begun_m)
        self._command.progress = float(np.clip(1 - gap / way, 0.0, 1.0)) if way > 0 else 1.0
        if gap < THERE_M or (still and gap <= NEAR_M):
            self._end(Ending.DONE)
        elif self._holding:
            self._end(Ending.HOLDING, f"at {1e3 * opening_m:.1f} mm")
        elif still:
            self._end(Ending.FAULT, f"the fingers are blocked at {1e3 * opening_m:.1f} mm")

    def _stay(self, ending: Ending) -> None:
        self._end(ending)
        if not self._holding:
            self._goal = self._goal._replace(opening_m=self._opening_m())

    def _end(self, ending: Ending, detail: str = "") -> None:
        if self._command is not None:
            self._command.end(ending, detail)
            self._command = None

    def _opening_m(self) -> float:
        return self._spec.opening_m(self._articulation.qpos[self._which].astype(float))
