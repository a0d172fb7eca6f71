"""Ways with a detour: over a via-point if one will do, planned if not."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tr_grasp.dynamic.scene import Scene
from tr_grasp.dynamic.tool_path import moved_along_tool
from tr_grasp.motion import (
    IKCfg,
    JointState,
    MotionLimits,
    Outcome,
    Plan,
    Planner,
    PlannerCfg,
    Trajectory,
    inverse_kinematics,
    time_optimal,
)
from tr_grasp.motion.edges import edge_is_free

Array = NDArray[np.floating]

RESOLUTION_RAD = 0.05
BACK_M, UP_M = (0.1, 0.2), (0.12, 0.25)
"""How far via-points lie behind the pre-grasp, against the approach, and above it."""
PLANNER = PlannerCfg(time_limit_s=5.0, rounds_n=1500, shortcuts_n=25, resolution_rad=0.03)
"""Some 0.2 s on an idle processor, and as many rounds on a busy one. Finer than motions are checked afterwards, else
these find contacts at corners that a plan has only grazed."""
_NEAR = IKCfg(rounds_n=0)


def way_around(
    scene: Scene,
    limits: MotionLimits,
    start: JointState,
    start_s: float,
    q: Array,
    arrival_s: float,
    previous: Plan | None = None,
) -> tuple[Plan, Trajectory] | None:
    """A path to joints whose straight line is blocked, and its timing from the speed that the arm has.

    Args:
        scene: What is in the way, with what moves where it will be on the arrival.
        limits: Of the arm.
        start: Where it is and how it moves then.
        start_s: When it starts.
        q: (dof,) goal.
        arrival_s: When it should be there.
        previous: A plan to much the same goal, to begin with.

    Returns:
        Nothing where no way was found soon, or not from that speed.
    """
    for path in _over_via_points(scene, start.q, q, arrival_s):
        if (way := _timed(scene, limits, path, start, start_s)) is not None:
            return Plan(Outcome.OK, path, "joint"), way
    plan = Planner(scene.way, PLANNER).plan(start.q, q, previous=previous, time_s=arrival_s)
    if plan.outcome is not Outcome.OK or plan.path is None:
        return None
    way = _timed(scene, limits, plan.path, start, start_s)
    return None if way is None else (plan, way)


def _over_via_points(scene: Scene, start_q: Array, q: Array, time_s: float) -> Iterator[Array]:
    T = scene.kinematics.pose(q)
    vias = [moved_along_tool(T, back) for back in BACK_M]
    for up in UP_M:
        raised = np.array(T)
        raised[2, 3] += up
        vias.append(raised)
    for via in inverse_kinematics(scene.kinematics, np.array(vias), q, _NEAR).q_rad:
        if not np.isfinite(via).all():
            continue
        path = np.stack([start_q, via, q])
        if all(edge_is_free(scene.way, a, b, RESOLUTION_RAD, time_s) for a, b in pairwise(path)):
            yield path


def _timed(scene: Scene, limits: MotionLimits, path: Array, start: JointState, start_s: float) -> Trajectory | None:
    """The fastest motion along a path that leaves with the speed of the start; checked with everything in motion."""
    speed = None if np.abs(start.dq).max() < 1e-6 else start.dq
    way = time_optimal(path, limits, start_speed_rad_s=speed).trajectory
    return way if way is not None and scene.is_free(way, start_s) else None
