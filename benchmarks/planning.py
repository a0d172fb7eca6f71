"""Planning: ``python -m benchmarks.planning``.

Prints JSON rows: RRT-Connect in three scenes beside plain OMPL with a Python checker (one call for each state), and
plans for a moving goal with and without the plan before. Success, median and 95th percentile of the time, length.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Callable

import numpy as np
import pinocchio as pin
from ompl import base as ob
from ompl import geometric as og

from benchmarks._arms import ROBOTS, SCENES, Array, free_posture, kinematics, obstacles, tool_down
from benchmarks._common import now_s, print_row
from tr_grasp.motion import CollisionModel, Plan, Planner, PlannerCfg, inverse_kinematics
from tr_grasp.motion.edges import path_length, points_of
from tr_grasp.motion.joint_turns import distance
from tr_grasp.motion.planner import SAME_POSTURE_RAD
from tr_grasp.motion.reuse import rest_of
from tr_grasp.motion.rrt_connect import rrt_connect

Pair = tuple[Array, Array]
Found = tuple[Array | None, float]


def random_pairs(model: CollisionModel, n: int, rng: np.random.Generator) -> list[Pair]:
    """Free postures, anywhere."""
    return [(free_posture(model, rng), free_posture(model, rng)) for _ in range(n)]


def hard_pairs(model: CollisionModel, n: int, rng: np.random.Generator) -> list[Pair]:
    """From left of the posts to right of them, where the straight line is blocked."""
    pairs: list[Pair] = []
    while len(pairs) < n:
        ends = []
        for side in (1.0, -1.0):
            T = tool_down(rng.uniform(0.42, 0.55), side * rng.uniform(0.28, 0.38), rng.uniform(0.12, 0.25))
            found = inverse_kinematics(model.kinematics, T, ends[0] if ends else None).all_of()
            ends.append(next((q for q in found if model.free(q)[0]), None))
            if ends[-1] is None:
                break
        if ends[-1] is not None and not model.free(points_of(np.array(ends), 0.05)).all():
            pairs.append((ends[0], ends[1]))
    return pairs


def plain_ompl(
    model: CollisionModel, start: Array, goal: Array, cfg: PlannerCfg, simplify_s: float
) -> tuple[Found, Found]:
    """Paths and times of OMPL's simple set-up as its tutorials use it: as found, and simplified."""
    dof, arm = len(start), model.kinematics
    space, bounds = ob.RealVectorStateSpace(dof), ob.RealVectorBounds(dof)
    for i in range(dof):
        bounds.setLow(i, float(max(arm.lower_rad[i], min((start[i] + goal[i]) / 2 - np.pi, start[i], goal[i]))))
        bounds.setHigh(i, float(min(arm.upper_rad[i], max((start[i] + goal[i]) / 2 + np.pi, start[i], goal[i]))))
    space.setBounds(bounds)
    setup = og.SimpleSetup(space)
    parts = (model._model, model._data, model._shapes, model._results)
    joints = range(dof)
    setup.setStateValidityChecker(
        lambda state: not pin.computeCollisions(*parts, np.array([state[i] for i in joints]), True)
    )
    information = setup.getSpaceInformation()
    information.setStateValidityCheckingResolution(cfg.resolution_rad / space.getMaximumExtent())
    planner = og.RRTConnect(information)
    planner.setRange(cfg.range_rad)
    setup.setPlanner(planner)
    states = [space.allocState(), space.allocState()]
    for state, q in zip(states, (start, goal), strict=True):
        for i in joints:
            state[i] = float(q[i])
    setup.setStartAndGoalStates(*states)

    def path() -> Array:
        solution = setup.getSolutionPath()
        return np.array([[solution.getState(i)[j] for j in joints] for i in range(solution.getStateCount())])

    begun = now_s()
    found = bool(setup.solve(cfg.time_limit_s)) and setup.haveExactSolutionPath()
    seconds = now_s() - begun
    if not found:
        return (None, seconds), (None, seconds)
    raw = path()
    setup.simplifySolution(simplify_s)
    return (raw, seconds), (path(), now_s() - begun)


def search_alone(model: CollisionModel, start: Array, goal: Array, cfg: PlannerCfg) -> Found:
    """RRT-Connect as the planner runs it, without shortcuts and checks after it."""
    begun = now_s()
    path = rrt_connect(model, start, goal[None], cfg, until=time.perf_counter() + cfg.time_limit_s)
    return path, now_s() - begun


def numbers(found: list[Found]) -> dict[str, float | str]:
    """Success, times in ms, length."""
    ms = np.array([seconds for _, seconds in found]) * 1e3
    lengths = [path_length(path) for path, _ in found if path is not None]
    return {
        "success": f"{len(lengths)}/{len(found)}",
        "median_ms": round(float(np.median(ms)), 1),
        "mean_ms": round(float(ms.mean()), 1),
        "p95_ms": round(float(np.percentile(ms, 95)), 1),
        "length_rad": round(float(np.mean(lengths)), 2) if lengths else 0.0,
    }


def scene_rows(robot: str, scene: str, pairs_n: int, cfg: PlannerCfg) -> None:
    """The search by itself and the whole plan, each beside its counterpart of plain OMPL; they take turns."""
    model, rng = CollisionModel(kinematics(robot), obstacles(scene)), np.random.default_rng(0)
    pairs = (hard_pairs if scene == "hard" else random_pairs)(model, pairs_n, rng)
    planner = Planner(model, cfg)
    ours, theirs, plans, simplified = [], [], [], []
    for start, goal in pairs:
        ours.append(search_alone(model, start, goal, cfg))
        raw, short = plain_ompl(model, start, goal, cfg, simplify_s=0.3)
        theirs.append(raw)
        simplified.append(short)
        begun = now_s()
        plan = planner.plan(start, goal, mode="rrt_connect")
        plans.append((plan.path, now_s() - begun))
    for name, mine, peer in (("search", ours, theirs), ("search, shortcuts, checks", plans, simplified)):
        row, peer_row = numbers(mine), numbers(peer)
        print_row(
            f"{robot}, {scene}: {name}",
            float(row.pop("median_ms")),
            "plain OMPL, Python checker" + (", simplifySolution" if mine is plans else ""),
            float(peer_row.pop("median_ms")),
            **row,
            **{f"peer_{key}": value for key, value in peer_row.items()},
            pairs_checked=model.pairs_n,
        )


Replan = Callable[[Planner, Array, Array, Plan | None], Plan]
REUSED = "the plan before is reused"
WAYS: dict[str, Replan] = {
    REUSED: lambda planner, q, T, before: planner.plan(q, T, previous=before),
    "RRT-Connect from scratch": lambda planner, q, T, before: planner.plan(q, T, mode="rrt_connect"),
    "straight lines, then RRT-Connect, from scratch": lambda planner, q, T, before: planner.plan(q, T),
}


def moving_goals(replan: Replan, trials: int, cfg: PlannerCfg) -> list[dict]:
    """Goals that pass the posts at 2-4 cm/s; a new plan for every 0.08 rad of motion along the one before.

    A row holds milliseconds, how the plan was found, its largest deviation from what was left of the plan before, and
    whether the goal can still be had in the posture in which that one ends.
    """
    model = CollisionModel(kinematics("ur5_rg2"), obstacles("hard"))
    planner, rows = Planner(model, cfg), []
    for trial in range(trials):
        rng = np.random.default_rng(trial)
        x, y, speed = rng.uniform(0.5, 0.6), rng.uniform(-0.35, -0.25), rng.uniform(0.02, 0.04)
        q, before = np.array([1.2, -1.4, 1.2, -1.4, -1.57, 0.0]), None
        for tick in range(20):
            T = tool_down(x, y + speed * tick, 0.12)
            begun = now_s()
            plan = replan(planner, q, T, before)
            ms = (now_s() - begun) * 1e3
            if before is not None:  # without one there is nothing to reuse
                kept = keeps_posture(model, before, T)
                rows.append({"ms": ms, "plan": plan, "deviation_rad": deviation(before, plan, q), "kept": kept})
            if plan.path is not None and len(plan.path) > 1:
                q, before = along(plan.path, 0.08), plan
    return rows


def keeps_posture(model: CollisionModel, before: Plan, T: Array) -> bool:
    """Whether a free posture for the goal is near the one in which the plan before ends."""
    found = inverse_kinematics(model.kinematics, T, before.path[-1]).all_of()
    return bool((distance(found[model.free(found)], before.path[-1]) < SAME_POSTURE_RAD).any()) if len(found) else False


def deviation(before: Plan | None, plan: Plan, q: Array) -> float:
    """Largest distance of joints between a plan and the rest of the one before; NaN where one of them is missing."""
    if before is None or plan.path is None or len(plan.path) < 2:
        return float("nan")
    return float(np.abs(even(rest_of(before.path, q)) - even(plan.path)).max())


def even(path: Array, n: int = 60) -> Array:
    """Points (n, dof) at equal distances along a path."""
    s = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1)))
    return np.stack([np.interp(np.linspace(0.0, s[-1], n), s, column) for column in path.T], axis=1)


def along(path: Array, way: float) -> Array:
    """The point at a distance from the start."""
    s = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1)))
    return np.array([np.interp(way, s, column) for column in path.T])


def seeding_rows(trials: int, cfg: PlannerCfg) -> None:
    """With the plan before, beside two ways without it; each way goes on along its own plans."""
    found = {way: moving_goals(replan, trials, cfg) for way, replan in WAYS.items()}
    for name, asked in (("all goals", False), ("goals within reach of the posture before", True)):
        numbers_of = {way: seeding_numbers([r for r in rows if r["kept"] or not asked]) for way, rows in found.items()}
        for way in list(WAYS)[1:]:
            row, peer = dict(numbers_of[REUSED]), dict(numbers_of[way])
            ratios = {key: round(peer[key] / row[key], 2) for key in row if key.endswith(("_ms", "_rad"))}
            print_row(
                f"ur5_rg2, moving goal, {name}: {REUSED}",
                row.pop("median_ms"),
                way,
                peer.pop("median_ms"),
                **row,
                **{f"peer_{key}": value for key, value in peer.items()},
                ratios=ratios,
            )


def seeding_numbers(rows: list[dict]) -> dict:
    """Times and deviations of one way."""
    ms = np.array([row["ms"] for row in rows])
    leaps = np.array([row["deviation_rad"] for row in rows if np.isfinite(row["deviation_rad"])])
    return {
        "median_ms": round(float(np.median(ms)), 1),
        "mean_ms": round(float(ms.mean()), 1),
        "p95_ms": round(float(np.percentile(ms, 95)), 1),
        "deviation_median_rad": round(float(np.median(leaps)), 4),
        "deviation_mean_rad": round(float(leaps.mean()), 4),
        "plans": len(rows),
        "ways": dict(Counter(row["plan"].how or row["plan"].outcome.name for row in rows)),
    }


def main(args: list[str] | None = None) -> None:
    """Print all rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=int, default=30)
    parser.add_argument("--trials", type=int, default=12, help="moving goals")
    parser.add_argument("--time-limit", type=float, default=2.0, help="seconds for a plan")
    parser.add_argument("--robots", nargs="+", choices=ROBOTS, default=("panda", "ur5_rg2", "j2s7s300"))
    parser.add_argument("--scenes", nargs="+", choices=tuple(SCENES), default=tuple(SCENES))
    given = parser.parse_args(args)
    cfg = PlannerCfg(time_limit_s=given.time_limit)
    for robot in given.robots:
        for scene in given.scenes:
            if scene != "hard" or robot == "ur5_rg2":  # its goals are the UR5's
                scene_rows(robot, scene, given.pairs, cfg)
    if given.trials:
        seeding_rows(given.trials, cfg)


if __name__ == "__main__":
    main()
