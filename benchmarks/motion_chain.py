"""From a goal to an arm that stands there: ``python -m benchmarks.motion_chain --rows chain.jsonl``.

Random goals among boxes for every arm: plan, time, check, execute in SAPIEN. Every goal is a line in the file of rows
as soon as it is done; a run that was interrupted goes on where it stopped. Prints one JSON row for each arm: goals
reached without contact, the tool's error at the end and a quarter of a second later, times.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from pathlib import Path

import numpy as np

from benchmarks._arms import ROBOTS, SCENES, free_posture, kinematics, place
from benchmarks._common import print_row
from tr_grasp.envs.sapien_station import SapienStation
from tr_grasp.envs.things import Thing
from tr_grasp.hardware import finish
from tr_grasp.motion import CollisionModel, MotionLimits, Plan, Planner, PlannerCfg, Trajectory, time_optimal

MARGIN_M, CHECKED_MARGIN_M = 0.02, 0.01
"""By how much boxes are grown for the plan, and for the check of the trajectory, which rounds the plan's corners."""
REST_S = 0.25
SPACINGS_RAD = (0.08, 0.03)


def things(scene: str) -> list[Thing]:
    """The boxes of a scene; the first is the table."""
    return [Thing(f"{scene} {i}", place(*centre), size_m=size) for i, (size, centre) in enumerate(SCENES[scene])]


def model(robot: str, scene: str, margin_m: float) -> CollisionModel:
    """The arm among grown boxes."""
    return CollisionModel(kinematics(robot), [part for thing in things(scene) for part in thing.obstacles(margin_m)])


def timed(plan: Plan, limits: MotionLimits, checked: CollisionModel) -> Trajectory | None:
    """The fastest trajectory along a plan that keeps away from the boxes."""
    for spacing in SPACINGS_RAD:
        trajectory = time_optimal(plan.path, limits, spacing_rad=spacing).trajectory
        if trajectory is not None and checked.first_contact(trajectory) is None:
            return trajectory
    return None


class Chain:
    """One arm in one scene."""

    def __init__(self, robot: str, scene: str) -> None:
        self.arm = kinematics(robot)
        self.wide, self.narrow = model(robot, scene, MARGIN_M), model(robot, scene, CHECKED_MARGIN_M)
        self.planner = Planner(self.wide, PlannerCfg(time_limit_s=5.0))
        self.station = SapienStation.of(robot, things=things(scene))

    def run(self, goal: int) -> dict:
        """One goal: what became of it."""
        rng, station = np.random.default_rng(goal), self.station
        start, T_goal = free_posture(self.wide, rng), self.arm.pose(free_posture(self.wide, rng))
        plan = self.planner.plan(start, T_goal)
        row = {"plan_s": plan.seconds, "outcome": plan.outcome.name, "how": plan.how}
        if plan.path is None:
            return row
        begun = time.perf_counter()
        trajectory = timed(plan, station.arm.limits, self.narrow)
        row["timing_s"] = time.perf_counter() - begun
        if trajectory is None:
            return row | {"outcome": "NOT_TIMED"}
        station.arm.place(start)
        station.world.wait(0.02)
        station.world.forget_touches()
        begun = time.perf_counter()
        result = finish(station.arm.move(trajectory), station.world)
        at_end = self.error_mm(T_goal)
        station.world.wait(REST_S)
        return row | {
            "ending": result.ending.name,
            "duration_s": trajectory.duration_s,
            "executed_s": time.perf_counter() - begun,
            "error_at_end_mm": at_end,
            "error_mm": self.error_mm(T_goal),
            "touches": [[touch.link, touch.thing, touch.force_n] for touch in station.world.touches],
        }

    def error_mm(self, T_goal: np.ndarray) -> float:
        """How far the tool is from where it should be."""
        return float(np.linalg.norm(self.arm.pose(self.station.arm.state().q_rad)[:3, 3] - T_goal[:3, 3]) * 1e3)


def summary(robot: str, scene: str, rows: list[dict]) -> None:
    """Print what the rows of an arm come to."""
    done = [row for row in rows if "error_mm" in row]
    errors, at_end = (np.array([row[key] for row in done]) for key in ("error_mm", "error_at_end_mm"))
    planning = np.array([row["plan_s"] for row in rows]) * 1e3
    print_row(
        f"{robot}, {scene}: plan, time, execute",
        float(np.median(planning)),
        goals=len(rows),
        planned=len([row for row in rows if row["outcome"] == "OK"]),
        executed=len(done),
        without_contact=sum(not row["touches"] for row in done),
        error_mean_mm=round(float(errors.mean()), 4),
        error_max_mm=round(float(errors.max()), 4),
        error_at_end_mean_mm=round(float(at_end.mean()), 4),
        error_at_end_max_mm=round(float(at_end.max()), 4),
        plan_p95_ms=round(float(np.percentile(planning, 95)), 1),
        timing_median_ms=round(float(np.median([row["timing_s"] for row in done]) * 1e3), 1),
        motion_mean_s=round(float(np.mean([row["duration_s"] for row in done])), 2),
        failures=dict(Counter(row["outcome"] for row in rows if row["outcome"] != "OK")),
        ways=dict(Counter(row["how"] for row in done)),
    )


def main() -> None:
    """Run what is missing and print all rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=Path, default=Path("motion_chain.jsonl"), help="file of rows, goes on from it")
    parser.add_argument("--goals", type=int, default=100)
    parser.add_argument("--scene", choices=tuple(SCENES), default="boxes")
    parser.add_argument("--robots", nargs="+", choices=ROBOTS, default=ROBOTS)
    given = parser.parse_args()
    lines = given.rows.read_text().splitlines() if given.rows.exists() else []
    rows = {(row["robot"], row["scene"], row["goal"]): row for row in map(json.loads, lines)}
    for robot in given.robots:
        keys = [(robot, given.scene, goal) for goal in range(given.goals)]
        chain = Chain(robot, given.scene) if any(key not in rows for key in keys) else None
        for key in keys:
            if chain is not None and key not in rows:
                rows[key] = {"robot": robot, "scene": given.scene, "goal": key[2], **chain.run(key[2])}
                with given.rows.open("a") as file:
                    file.write(json.dumps(rows[key]) + "\n")
        summary(robot, given.scene, [rows[key] for key in keys])


if __name__ == "__main__":
    main()
