"""Carries a station's stages out through the hardware protocols: plan all, move, check the grip, try again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tr_grasp.errors import HardwareError
from tr_grasp.hardware import Ending, Result, Station, finish
from tr_grasp.motion import Trajectory
from tr_grasp.pick_place.outcome import StageRecord, TaskOutcome, TaskResult
from tr_grasp.pick_place.plan import PlannedStage, TaskPlan, plan_stages
from tr_grasp.pick_place.scene import PlanningScene
from tr_grasp.pick_place.station import StageCfg, StationCfg

Array = NDArray[np.floating]
Locate = Callable[[], "Sequence[StationCfg] | str"]
"""Looks, and gives the station with the poses of each grasp of what it saw, best first, or why there are none."""
GRASPS_N = 8
"""Grasps that are planned for, of those that looking gives."""
EACH_S = 6.0
SETTLE_S = 0.3
ARRIVED_RAD, ARRIVAL_LOOKS_N = 0.02, 10
"""A joint this near to where its motion ends has arrived; so often it is looked at while it settles."""
DEEPER_M = 0.010
LONGEST_S = 60.0


class BlindPickPlace:
    """Pick and place at taught poses.

    Everything is planned before anything moves. Fingers that close on nothing open again, the hand backs off and tries
    a centimetre deeper, or where the object is seen now.

    Args:
        cfg: The station.
        devices: What carries it out, simulated or real; a guard may stand before it.
        locate: Finds the object before each attempt; without it the task is blind.
        watch: Called after each stage with its record, for pictures and progress.

    Raises:
        ConfigError: The station does not fit its robot.
    """

    def __init__(
        self,
        cfg: StationCfg,
        devices: Station,
        *,
        locate: Locate | None = None,
        watch: Callable[[StageRecord], None] | None = None,
    ) -> None:
        self.cfg, self.devices = cfg, devices
        self._locate, self._watch = locate, watch
        self._scene = PlanningScene(cfg)
        self._records: list[StageRecord] = []
        self._held_m = 0.0

    def dry_run(self) -> TaskPlan | str:
        """Plan everything from where the arm is and move nothing; or why the object was not seen."""
        scenes = self._scenes_now(0)
        return scenes if isinstance(scenes, str) else self._first_planned(scenes)[1]

    def run(self, retries_n: int = 2) -> TaskResult:
        """Carry all stages out.

        Args:
            retries_n: How often a grip that failed is tried again.

        Returns:
            How it ended. A device that fails is a result too, and the arm is stopped.
        """
        self._records, retries = [], []
        for attempt in range(1, retries_n + 2):
            try:
                outcome, detail = self._attempt(attempt)
            except HardwareError as error:
                outcome, detail = TaskOutcome.NOT_MOVED, str(error)
            if outcome is TaskOutcome.NOT_MOVED:
                self.devices.arm.stop()
            if outcome is not TaskOutcome.MISSED or attempt > retries_n:
                break
            retries.append(detail)
        return TaskResult(outcome, detail, tuple(self._records), tuple(retries))

    def _attempt(self, attempt: int) -> tuple[TaskOutcome, str]:
        scenes = self._scenes_now(attempt - 1)
        if isinstance(scenes, str):
            return TaskOutcome.NOT_FOUND, scenes
        scene, plan = self._first_planned(scenes)
        if not plan.succeeded:
            return TaskOutcome.NO_PLAN, plan.reason
        holding = False
        for step in plan.stages:
            begun = self.devices.world.now_s
            result = self._carry_out(step)
            outcome = self._judge(step, result, holding)
            if step.stage.do == "close":
                self._held_m = self.devices.gripper.state().opening_m
            holding = step.stage.do == "close" or (holding and step.stage.do != "open")
            detail = "" if outcome is None else self._detail(step, result, outcome)
            self._note(StageRecord(step.stage.name, attempt, begun, self.devices.world.now_s, detail))
            if outcome is TaskOutcome.MISSED and (problem := self._back_off(scene, attempt)):
                return TaskOutcome.NOT_MOVED, problem
            if outcome is not None:
                return outcome, detail
        return TaskOutcome.DONE, ""

    def _scenes_now(self, tries_n: int) -> list[PlanningScene] | str:
        if self._locate is not None:
            seen = self._locate()
            return seen if isinstance(seen, str) else [PlanningScene(cfg) for cfg in seen[:GRASPS_N]]
        if not tries_n:
            return [self._scene]
        approach = self._scene.goal(self.cfg.grasp)[:3, 2]
        x, y, z = tries_n * DEEPER_M * approach
        return [PlanningScene(self.cfg.with_grasp_shifted((x, y, z)))]

    def _first_planned(self, scenes: Sequence[PlanningScene]) -> tuple[PlanningScene, TaskPlan]:
        """The first of several grasps for which all stages have a plan; the very first, if none has."""
        if len(scenes) == 1:
            return scenes[0], plan_stages(scenes[0], self._q(), self.cfg.stages)
        tried = []
        for scene in scenes:
            plan = plan_stages(scene, self._q(), self.cfg.stages, limit_s=EACH_S)
            if plan.succeeded:
                return scene, plan
            tried.append((scene, plan))
        scene, plan = tried[0]
        return scene, replace(plan, reason=f"{plan.reason}; nor for {len(tried) - 1} other grasps")

    def _carry_out(self, step: PlannedStage) -> Result:
        devices = self.devices
        if step.trajectory is not None:
            result = finish(devices.arm.move(step.trajectory), devices.world, limit_s=step.duration_s + LONGEST_S)
            return self._arrived(step.trajectory) if result.succeeded else result
        low, high = devices.gripper.opening_range_m
        goal_m = max(low, 0.0) if step.stage.do == "close" else high
        result = finish(devices.gripper.move(goal_m, force_n=self.cfg.grip_force_n), devices.world, limit_s=LONGEST_S)
        devices.world.wait(SETTLE_S)
        return result

    def _arrived(self, trajectory: Trajectory) -> Result:
        """Whether the arm stands where a motion ends: one that somebody halted may have been led there in vain."""
        away = np.inf
        for _ in range(ARRIVAL_LOOKS_N):
            away = float(np.abs(self.devices.arm.state().q_rad - trajectory.q_rad[-1]).max())
            if away < ARRIVED_RAD:
                return Result(Ending.DONE)
            self.devices.world.wait(SETTLE_S / ARRIVAL_LOOKS_N)
        return Result(Ending.FAULT, f"a joint is {away:.3g} rad from where it was told to be")

    def _judge(self, step: PlannedStage, result: Result, holding: bool) -> TaskOutcome | None:
        """What went wrong in a stage, if anything did."""
        if not result.succeeded:
            return TaskOutcome.NOT_MOVED
        if step.stage.do == "close":
            return None if result.ending is Ending.HOLDING else TaskOutcome.MISSED
        lost = holding and self.devices.gripper.state().opening_m < self._held_m / 2
        return TaskOutcome.DROPPED if lost else None

    def _detail(self, step: PlannedStage, result: Result, outcome: TaskOutcome) -> str:
        if outcome is TaskOutcome.NOT_MOVED:
            return f"{step.stage.name}: {result.reason}"
        opening = self.devices.gripper.state().opening_m
        return f"{step.stage.name}: the fingers are {1e3 * opening:.0f} mm apart"

    def _back_off(self, scene: PlanningScene, attempt: int) -> str:
        """Open the fingers and go back to where the approach began; why that failed, if it did."""
        stages = (StageCfg("open again", "open"), StageCfg("back off", "line", self.cfg.approach[-2]))
        opened, *moved = plan_stages(scene, self._q(), stages).stages
        for step in (opened, *moved):
            begun = self.devices.world.now_s
            result = self._carry_out(step)
            reason = "" if result.succeeded else f"{step.stage.name}: {result.reason}"
            self._note(StageRecord(step.stage.name, attempt, begun, self.devices.world.now_s, reason))
            if reason:
                return reason
        return "" if moved else "back off: there is no straight way back from the grasp"

    def _note(self, record: StageRecord) -> None:
        self._records.append(record)
        if self._watch is not None:
            self._watch(record)

    def _q(self) -> Array:
        return np.asarray(self.devices.arm.commanded().q, float)
