"""A way around obstacles: RRT-Connect of OMPL, with whole edges checked in one call."""

from __future__ import annotations

import itertools
import time
from typing import Any

import numpy as np
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from tr_grasp.motion.arguments import Array
from tr_grasp.motion.collision import CollisionModel
from tr_grasp.motion.edges import edge_is_free
from tr_grasp.motion.joint_turns import TURN
from tr_grasp.motion.plan import Cancel, PlannerCfg

ou.setLogLevel(ou.LogLevel.LOG_NONE)


def rrt_connect(
    model: CollisionModel,
    start: Array,
    goals: Array,
    cfg: PlannerCfg,
    *,
    until: float,
    cancel: Cancel | None = None,
    time_s: float = 0.0,
) -> Array | None:
    """A free path (n, dof) from a start (dof,) to one of the goals (m, dof), or nothing in the time allowed.

    Args:
        model: What is free.
        start: Free, and within the joint limits.
        goals: Likewise.
        cfg: Settings.
        until: When to give up, on the clock of ``time.thread_time``.
        cancel: Asked again and again; true gives up.
        time_s: Time of the world at which obstacles are taken to stand.

    Source: Kuffner & LaValle 2000, RRT-Connect.
    """
    dof = len(start)
    space = _space(model, start, goals)
    information = ob.SpaceInformation(space)
    # Starts, goals and edges were or will be checked; states by themselves need not be.
    information.setStateValidityChecker(lambda state: True)
    validator = _Edges(information, model, dof, cfg.resolution_rad, time_s)
    information.setMotionValidator(validator)
    information.setup()

    problem = ob.ProblemDefinition(information)
    problem.addStartState(_state(space, start))
    region = ob.GoalStates(information)
    for goal in goals:
        region.addState(_state(space, goal))
    problem.setGoal(region)

    ou.RNG.setSeed(cfg.seed)
    planner = og.RRTConnect(information)
    planner.setRange(cfg.range_rad)
    planner.setProblemDefinition(problem)
    planner.setup()
    rounds = itertools.count(1)

    def over() -> bool:
        spent = cfg.rounds_n is not None and next(rounds) > cfg.rounds_n
        return spent or time.thread_time() > until or (cancel is not None and cancel())

    if not planner.solve(ob.PlannerTerminationCondition(over)) or not problem.hasExactSolution():
        return None
    path: Any = problem.getSolutionPath()  # a PathGeometric, which the bindings declare as a Path
    return np.array([[path.getState(i)[j] for j in range(dof)] for i in range(path.getStateCount())])


class _Edges(ob.MotionValidator):
    def __init__(self, information, model: CollisionModel, dof: int, resolution_rad: float, time_s: float) -> None:
        super().__init__(information)
        self._model, self._joints, self._time_s = model, range(dof), time_s
        self._resolution_rad = resolution_rad

    # The name is OMPL's.
    def checkMotion(self, first, second, *_) -> bool:
        a, b = (np.array([state[i] for i in self._joints]) for state in (first, second))
        return edge_is_free(self._model, a, b, self._resolution_rad, self._time_s)


def _space(model: CollisionModel, start: Array, goals: Array) -> ob.RealVectorStateSpace:
    """Joint space: the limits, but of joints that turn further no more than a turn around where the motion is."""
    arm = model.kinematics
    ends = np.vstack([start, goals])
    middle = (ends.min(0) + ends.max(0)) / 2
    half = np.maximum(TURN / 2, (ends.max(0) - ends.min(0)) / 2)
    # Start and goal may lie on a limit, and OMPL compares strictly.
    lower = np.minimum(np.maximum(arm.lower_rad, middle - half), ends.min(0)) - 1e-9
    upper = np.maximum(np.minimum(arm.upper_rad, middle + half), ends.max(0)) + 1e-9
    space = ob.RealVectorStateSpace(len(start))
    bounds = ob.RealVectorBounds(len(start))
    for i, (low, high) in enumerate(zip(lower, upper, strict=True)):
        bounds.setLow(i, float(low))
        bounds.setHigh(i, float(high))
    space.setBounds(bounds)
    return space


def _state(space: ob.RealVectorStateSpace, q: Array):
    state: Any = space.allocState()  # of real numbers, which the bindings declare as any state
    for i, angle in enumerate(q):
        state[i] = float(angle)
    return state
