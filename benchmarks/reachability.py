"""Reachability and ranking: ``python -m benchmarks.reachability``.

Prints JSON rows: the margin of 100 tool poses and its gradient beside labelling them by inverse kinematics, and the
ranking of 100 grasps by every method. ``TR_GRASP_BENCH_CLOCK=cpu`` measures the processor's time instead of the wall's.
"""

from __future__ import annotations

import argparse
from typing import get_args

import numpy as np
import torch

from benchmarks._common import median_ms, print_row
from tr_grasp.grasps import shipped_grasp_set
from tr_grasp.grasps.motion_aware import motion_aware_scorer, shipped_scorers
from tr_grasp.grasps.ranking import RankingAids, RankingName, rank_grasps
from tr_grasp.grasps.reachability import Labeller, reachability_field
from tr_grasp.motion import CollisionModel, Kinematics, box
from tr_grasp.robots import robot_spec

ARM, OBJECT, POSES_N = "ur5_robotiq_2f85", "010_potted_meat_can", 100


def main() -> None:
    """Print the rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=15)
    args = parser.parse_args()
    torch.set_num_threads(1)
    field, kinematics = reachability_field(ARM), Kinematics(robot_spec(ARM))
    T, label = field.domain.sample(POSES_N, np.random.default_rng(0)), Labeller(kinematics)
    margin, gradient, labels = median_ms(
        lambda: field.values(T), lambda: field.gradient(T), lambda: label(T), repeats=args.repeats
    )
    print_row(f"margin of {POSES_N} poses", margin, "inverse kinematics with collision check", labels)
    print_row(f"gradient of {POSES_N} margins", gradient)

    grasps = shipped_grasp_set(OBJECT)
    grasps = grasps.subset(np.resize(np.arange(len(grasps)), POSES_N))
    T_base_obj, T_floor = np.eye(4), np.eye(4)
    T_base_obj[:3, 3], T_floor[2, 3] = (0.5, 0.1, 0.05), -0.055
    collisions = CollisionModel(kinematics, [box("floor", (4, 4, 0.1), T_floor)])
    scorer = motion_aware_scorer(OBJECT) if OBJECT in shipped_scorers() else None
    aids = RankingAids(field, scorer, np.array([0.03, 0.0, 0.0]), collisions)
    q = kinematics.home_q_rad
    for method in get_args(RankingName):
        if method in ("none", "motion") and (method == "none" or scorer is None):
            continue
        (with_all,) = median_ms(
            lambda m=method: rank_grasps(kinematics, grasps, T_base_obj, q, m, 0.075, aids), repeats=args.repeats
        )
        kept = len(rank_grasps(kinematics, grasps, T_base_obj, q, method, 0.075, aids))
        print_row(f"ranking of {POSES_N} grasps: {method}, with collision checks", with_all, kept=kept)


if __name__ == "__main__":
    main()
