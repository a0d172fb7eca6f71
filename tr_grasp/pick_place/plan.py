"""All stages planned one after the other; where one fails, the posture before it is tried another way."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from tr_grasp.motion import (
    CollisionModel,
    IKCfg,
    Outcome,
    Plan,
    Planner,
    PlannerCfg,
    Trajectory,
    inverse_kinematics,
    time_optimal,
)
from tr_grasp.pick_place.scene import PlanningScene
from tr_grasp.pick_place.station import StageCfg

Array = NDArray[np.floating]
Where = Literal["there", "held", "placed"]
"""Where the object is: still where it is to be taken, in the hand, or put down."""
POSTURES_N = 6
BRANCHES_N = 3
"""Postures of a pose that are tried before the one of the stage before is taken to be wrong."""


@dataclass(frozen=True, eq=False)
class PlannedStage:
    """A stage with its motion; fingers that open or close have none.

    Attributes:
        stage: What it is.
        plan: The path.
        trajectory: The path with its times.
    """

    stage: StageCfg
    plan: Plan | None = None
    trajectory: Trajectory | None = None

    @property
    def duration_s(self) -> float:
        """Of the motion."""
        return 0.0 if self.trajectory is None else self.trajectory.duration_s


@dataclass(frozen=True, eq=False)
class TaskPlan:
    """A motion for every stage, or the one that has none and why.

    Attributes:
        stages: Those that are planned, in order.
        failed: The stage that could not be planned.
        reason: Why; empty if there is a plan for all.
        seconds: Time it took.
    """

    stages: tuple[PlannedStage, ...]
    failed: StageCfg | None = None
    reason: str = ""
    seconds: float = 0.0

    @property
    def succeeded(self) -> bool:
        """Every stage has its motion."""
        return self.failed is None


def plan_stages(
    scene: PlanningScene, start_q: Array, stages: Sequence[StageCfg], *, holding: bool = False, limit_s: float = 20.0
) -> TaskPlan:
    """A motion for every stage, each from where the one before ends.

    Args:
        scene: The station.
        start_q: (dof,) where the arm is.
        stages: What is to be planned.
        holding: The object is in the hand at the start.
        limit_s: Wall time after which no other posture is tried.
    """
    begun = time.perf_counter()
    search = _Search(scene, begun + limit_s)
    found = search.on(np.asarray(start_q, float), tuple(stages), "held" if holding else "there")
    seconds = time.perf_counter() - begun
    if found is not None:
        return TaskPlan(tuple(found), seconds=seconds)
    planned, failed, reason = search.furthest
    return TaskPlan(tuple(planned), failed, reason, seconds)


class _Search:
    """Depth first over the postures of the stages' poses."""

    def __init__(self, scene: PlanningScene, until: float) -> None:
        self._scene, self._until = scene, until
        self.furthest: tuple[list[PlannedStage], StageCfg | None, str] = ([], None, "")
        self._done: list[PlannedStage] = []

    def on(self, q: Array, stages: tuple[StageCfg, ...], where: Where) -> list[PlannedStage] | None:
        """The rest of the plan from joints on."""
        if not stages:
            return []
        stage, *rest = stages
        if stage.do in ("close", "open"):
            return self._then(PlannedStage(stage), q, tuple(rest), "held" if stage.do == "close" else "placed")
        tries_n = 0
        for plan in self._plans(stage, q, where):
            step = self._timed(stage, plan)
            if step.trajectory is None:
                self._note(stage, f"{stage.name}: {plan.reason}" if plan.path is None else "it cannot be timed")
                continue
            whole = self._then(step, step.trajectory.q_rad[-1], tuple(rest), where)
            tries_n += 1
            if whole is not None:
                return whole
            if tries_n >= BRANCHES_N or time.perf_counter() > self._until:
                break
        return None

    def _then(
        self, step: PlannedStage, q: Array, rest: tuple[StageCfg, ...], where: Where
    ) -> list[PlannedStage] | None:
        self._done.append(step)
        further = self.on(q, rest, where)
        self._done.pop()
        return None if further is None else [step, *further]

    def _plans(self, stage: StageCfg, q: Array, where: Where) -> Iterator[Plan]:
        model = self._model(stage, where)
        planner, goal = Planner(model, PlannerCfg(time_limit_s=1.5)), self._scene.goal(stage.to)
        if stage.do == "line":
            yield planner.plan(q, goal, mode="cartesian")
            return
        if goal.ndim == 1:
            yield planner.plan(q, goal)
            return
        postures = inverse_kinematics(self._scene.empty_hand, goal, q, IKCfg(postures_n=POSTURES_N)).all_of()
        if not len(postures):
            yield Plan(Outcome.UNREACHABLE, detail=f"tool at {np.round(goal[:3, 3], 3).tolist()} m")
        for posture in postures:
            yield planner.plan(q, posture)

    def _model(self, stage: StageCfg, where: Where) -> CollisionModel:
        if where == "held":
            return self._scene.full_hand
        if stage.do == "line":
            return self._scene.at_object
        return self._scene.before_grip if where == "there" else self._scene.after_release

    def _timed(self, stage: StageCfg, plan: Plan) -> PlannedStage:
        if plan.path is None:
            return PlannedStage(stage, plan)
        return PlannedStage(stage, plan, time_optimal(plan.path, self._scene.limits).trajectory)

    def _note(self, stage: StageCfg, reason: str) -> None:
        if self.furthest[1] is None or len(self._done) > len(self.furthest[0]):
            self.furthest = (list(self._done), stage, reason)
