"""Two ways to execute the steps of Task I: ``python -m benchmarks.execution --rows execution.jsonl``.

The scripted expert plays the same episodes with the Cartesian controller and with a planned, collision-checked motion
for each step (the thesis' way, with MoveIt). Every episode is a line in the file of rows as soon as it is done; a run
that was interrupted goes on where it stopped. Prints one JSON row for each arm: success, steps, time of a step.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from pathlib import Path

import numpy as np

from benchmarks._arms import ROBOTS
from benchmarks._common import print_row
from tr_grasp import keys
from tr_grasp.configs import ActionCfg, EnvCfg, ObjectsCfg, ObservationCfg
from tr_grasp.envs import TorchRLGraspEnv, make_env
from tr_grasp.evaluation.statistics import Counts, wilson_interval

WAYS = ("cartesian", "planned")


def episode(env: TorchRLGraspEnv, seed: int) -> dict:
    """One episode of the expert."""
    env.set_seed(seed)
    td, spent, outcomes = env.reset(), [], Counter()
    while True:
        td.set(keys.ACTION, td[keys.EXPERT_ACTION])
        begun = time.perf_counter()
        env.step(td)
        spent.append(time.perf_counter() - begun)
        plan = getattr(env.task.controller, "plan", None)
        outcomes[plan.outcome.name if plan else "-"] += 1
        if bool(td["next", "done"]):
            success = bool(td["next", keys.SUCCESS])
            return {"success": success, "steps": len(spent), "step_s": float(np.mean(spent)), "plans": dict(outcomes)}
        td = td["next"].select(*env.observation_spec.keys())


def main() -> None:
    """Run what is missing and print all rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=Path, default=Path("execution.jsonl"), help="file of rows, goes on from it")
    parser.add_argument("--episodes", type=int, default=30)
    parser.add_argument("--seed", type=int, default=30_000)
    parser.add_argument("--robots", nargs="+", choices=ROBOTS, default=ROBOTS)
    given = parser.parse_args()
    lines = given.rows.read_text().splitlines() if given.rows.exists() else []
    rows = {(row["robot"], row["way"], row["seed"]): row for row in map(json.loads, lines)}
    seeds = range(given.seed, given.seed + given.episodes)
    for robot in given.robots:
        for way in WAYS:
            missing = [seed for seed in seeds if (robot, way, seed) not in rows]
            if not missing:
                continue
            env = make_env(
                EnvCfg(
                    robot=robot,
                    action=ActionCfg(execution=way),
                    objects=ObjectsCfg(split="test", count_range=(1, 1)),
                    observation=ObservationCfg(expert_labels=True, stack_n=1),
                )
            )
            for seed in missing:
                row = {"robot": robot, "way": way, "seed": seed, **episode(env, seed)}
                rows[robot, way, seed] = row
                with given.rows.open("a") as file:
                    file.write(json.dumps(row) + "\n")
            env.close()
        summary(robot, {way: [rows[robot, way, seed] for seed in seeds] for way in WAYS})


def summary(robot: str, rows: dict[str, list[dict]]) -> None:
    """Print both ways of an arm side by side."""
    columns = {way: numbers(found) for way, found in rows.items()}
    mine, peer = columns["planned"], columns["cartesian"]
    print_row(
        f"{robot}, Task I: planned steps",
        mine.pop("step_ms"),
        "Cartesian steps",
        peer.pop("step_ms"),
        **mine,
        **{f"peer_{key}": value for key, value in peer.items()},
    )


def numbers(rows: list[dict]) -> dict:
    """Of one arm and one way."""
    lifted = sum(row["success"] for row in rows)
    interval = wilson_interval(Counts(lifted, len(rows)))
    return {
        "step_ms": 1e3 * float(np.median([row["step_s"] for row in rows])),
        "success": f"{lifted}/{len(rows)}",
        "wilson_95": [round(interval.low, 3), round(interval.high, 3)],
        "steps_of_successes": round(float(np.mean([row["steps"] for row in rows if row["success"]] or [0])), 1),
        "plans": dict(sum((Counter(row["plans"]) for row in rows), Counter())),
    }


if __name__ == "__main__":
    main()
