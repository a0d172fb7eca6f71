"""Grasp sets: ``python -m benchmarks.grasps``.

Prints JSON rows for every set that comes with the package: candidates a second, tries a second, and how often its best
20 hold with misplacements that they have not seen, beside 20 random candidates.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks._common import machine, now_s
from tr_grasp.envs.grasp_trials import GraspTrials
from tr_grasp.evaluation.statistics import Counts, wilson_interval
from tr_grasp.grasps import BuildCfg, Grasps, candidate_grasps, shipped_grasp_set, shipped_objects
from tr_grasp.objects import conveyor_object

TOP = 20


def print_row(row: dict[str, Any]) -> None:
    """One JSON object on one line."""
    print(json.dumps(row | {"machine": machine()}), flush=True)


def held(trials: GraspTrials, grasps: Grasps, tries: int, seed: int) -> dict[str, float]:
    """Success of some grasps, each tried this often, with its interval and the tries a second."""
    rng, started = np.random.default_rng(seed), now_s()
    successes = sum(int(trials(grasps, rng).sum()) for _ in range(tries))
    counts = Counts(successes, tries * len(grasps))
    low, high = wilson_interval(counts)
    seconds = now_s() - started
    return {"held": counts.rate, "low": low, "high": high, "n": counts.n, "tries_per_s": counts.n / seconds}


def main() -> None:
    """Print the rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tries", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1000)
    parser.add_argument("--objects", nargs="*", default=shipped_objects())
    args = parser.parse_args()
    for name in args.objects:
        found, thing = shipped_grasp_set(name), conveyor_object(name)
        cfg = replace(BuildCfg(), seed=args.seed)
        started = now_s()
        free, checked_n = candidate_grasps(thing.model, found.gripper, cfg)
        seconds = now_s() - started
        chance = free.subset(np.random.default_rng(args.seed).permutation(len(free))[:TOP])
        trials = GraspTrials(thing.model, thing.mass_kg, found.gripper, cfg.trial)
        rate = checked_n / seconds
        print_row({"object": name, "candidates_per_s": rate, "free": len(free), "grasps": len(found)})
        for kind, grasps in ((f"best {TOP}", found.top(TOP).grasps), (f"random {TOP}", chance)):
            print_row({"object": name, "grasps": kind, **held(trials, grasps, args.tries, args.seed + 1)})


if __name__ == "__main__":
    main()
