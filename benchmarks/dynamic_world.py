"""What the world of Task II costs without a method: ``python -m benchmarks.dynamic_world``.

Processor time of a physics step with the judge watching and the arm on a long trajectory, of building a scene, and of a
trial of 30 simulated seconds. Prints one JSON row for each case.
"""

from __future__ import annotations

import argparse
import time
from statistics import median

import numpy as np

from benchmarks._common import print_row
from tr_grasp.configs.dynamic import DynamicCfg
from tr_grasp.envs.dynamic_grasp import DynamicScene, Judge, make_trial
from tr_grasp.motion import time_optimal

TRIAL_S = 30.0
CASES = (("linear", 240), ("linear", 120), ("linear_obstacles", 240), ("linear_slab", 240), ("sinusoidal", 240))


def measure(motion: str, physics_hz: int, repeats: int, simulated_s: float) -> tuple[float, float]:
    """Median processor seconds of building a scene, and of one step."""
    builds, steps = [], []
    for repeat in range(repeats + 1):
        begun = time.process_time()
        scene = DynamicScene.of(DynamicCfg(physics_hz=physics_hz), make_trial(motion, "006_mustard_bottle", repeat))
        judge, arm, world = Judge(scene), scene.station.arm, scene.station.world
        built = time.process_time()
        q = arm.commanded().q
        arm.move(time_optimal(np.stack([q, q + 0.1]), arm.limits).trajectory.slower(100.0))
        moved = time.process_time()
        world.wait(simulated_s)
        judge.tell(judge.phase)
        if repeat:  # the first one warms caches up
            builds.append(built - begun)
            steps.append((time.process_time() - moved) / (simulated_s * physics_hz))
    return median(builds), median(steps)


def main() -> None:
    """Measure every case."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--simulated-s", type=float, default=2.0)
    args = parser.parse_args()
    for motion, physics_hz in CASES:
        build_s, step_s = measure(motion, physics_hz, args.repeats, args.simulated_s)
        print_row(
            f"dynamic_world {motion} {physics_hz} Hz: one step",
            1e3 * step_s,
            build_cpu_s=round(build_s, 3),
            trial_cpu_s=round(build_s + TRIAL_S * physics_hz * step_s, 2),
        )


if __name__ == "__main__":
    main()
