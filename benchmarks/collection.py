"""Environment steps per second that a trainer's collectors hand over, by environments a process and by processes.

    python -m benchmarks.collection [steps]

The shipped policy acts; nothing learns meanwhile. Prints one JSON row a layout: rate, and the ratio to one environment
in one process of the same run. The first chunk of each worker, in which it starts, is not counted.
"""

from __future__ import annotations

import sys
import time

import torch

from benchmarks._common import print_row
from tr_grasp.envs import make_env
from tr_grasp.modules import load_policy
from tr_grasp.trainers.acting import ExploringPolicy
from tr_grasp.trainers.collect import Collection, CollectPlan

STEPS = 1_500
STEPS_PER_BATCH = 100
LAYOUTS = ((1, 1), (1, 2), (2, 1), (2, 2))
"""Processes, environments of each."""


def rate(workers_n: int, envs_per_worker_n: int, steps: int) -> float:
    """Steps per second."""
    policy, cfg = load_policy("panda")
    plan = CollectPlan(
        make_env=make_env,
        env=cfg.env,
        seed=0,
        segment=1,
        steps_per_batch=STEPS_PER_BATCH,
        mode="process",
        workers_n=workers_n,
        envs_per_worker_n=envs_per_worker_n,
        episode_steps=cfg.trainer.episode_steps,
    )
    with Collection(plan, ExploringPolicy(policy.requires_grad_(False), cfg.algorithm.action_noise)) as collection:
        chunks = iter(collection)
        for _ in range(workers_n):
            next(chunks)
        start, done = time.perf_counter(), 0
        while done < steps:
            done += next(chunks).numel()
        return done / (time.perf_counter() - start)


def main() -> None:
    """Run all measurements."""
    torch.set_num_threads(1)
    steps = int(sys.argv[1]) if len(sys.argv) > 1 else STEPS
    peer, peer_ms = None, None
    for workers_n, envs_n in LAYOUTS:
        per_s = rate(workers_n, envs_n, steps)
        name = f"{workers_n} process{'es' * (workers_n > 1)} x {envs_n} environment{'s' * (envs_n > 1)}"
        print_row(name, 1e3 / per_s, peer, peer_ms, per_s=round(per_s, 1))
        peer, peer_ms = peer or name, peer_ms or 1e3 / per_s


if __name__ == "__main__":
    main()
