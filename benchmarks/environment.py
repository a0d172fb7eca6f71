"""Environment step and camera, one core: against stock ManiSkill and SAPIEN's renderer where they can run.

    python -m benchmarks.environment

Prints one JSON row a measurement: median milliseconds, rate, and the ratio to the peer of the same run.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator

import torch

from benchmarks._common import print_row
from tr_grasp import keys
from tr_grasp.configs import CameraCfg, EnvCfg, ObjectsCfg, ObservationCfg
from tr_grasp.doctor import probe_vulkan
from tr_grasp.envs import make_env

STEPS = 300


def timed(run: Callable[[], object]) -> float:
    """Milliseconds of one call."""
    start = time.perf_counter()
    run()
    return 1e3 * (time.perf_counter() - start)


def step_times(cfg: EnvCfg) -> Iterator[float]:
    """Milliseconds of each step of scripted episodes; resets are not counted."""
    env = make_env(cfg, seed=0)
    td = env.reset()
    for _ in range(STEPS):
        td.set(keys.ACTION, td.get(keys.EXPERT_ACTION, torch.rand(5) * 2 - 1))
        yield timed(lambda td=td: env.step(td))
        td = env.reset() if bool(td["next", "done"]) else td["next"].select(*env.observation_spec.keys())
    env.close()


def stock_step_times() -> Iterator[float]:
    """The same for ManiSkill's own point-cloud observation at its 128 x 128 default."""
    import gymnasium as gym
    import mani_skill.envs  # noqa: F401

    env = gym.make("PickCube-v1", obs_mode="pointcloud", sim_backend="physx_cpu", render_backend="cpu")
    env.reset(seed=0)
    for _ in range(40):
        yield timed(lambda: env.step(env.action_space.sample()))
    env.close()


def camera_times(backend: str, size_px: int) -> Iterator[float]:
    """Milliseconds of a picture of four objects."""
    camera = CameraCfg(backend=backend, image_size_px=size_px)
    env = make_env(EnvCfg(camera=camera, objects=ObjectsCfg(count_range=(4, 4))), seed=0)
    env.reset()
    for _ in range(60):
        yield timed(env.task.view.capture)
    env.close()


def row(name: str, times: Iterator[float], peer: str | None = None, peer_ms: float | None = None) -> float:
    """Print one measurement and return its median."""
    values = list(times)[5:]
    median, mean = statistics.median(values), statistics.fmean(values)
    print_row(name, median, peer, peer_ms, mean_ms=round(mean, 3), per_s=round(1e3 / mean, 1))
    return median


def main() -> None:
    """Run all measurements."""
    torch.set_num_threads(1)
    vulkan, _ = probe_vulkan()
    peer = "stock ManiSkill PickCube-v1, pointcloud"
    stock = row(peer, stock_step_times()) if vulkan else None
    labelled = EnvCfg(observation=ObservationCfg(expert_labels=True))
    row("step with octree observation", step_times(EnvCfg()), peer, stock)
    row("step with octree observation and expert label", step_times(labelled), peer, stock)
    for size in (64, 80, 128):
        peer = f"SAPIEN camera {size} x {size}"
        sapien = row(peer, camera_times("sapien", size)) if vulkan else None
        row(f"ray-cast camera {size} x {size}", camera_times("raycast", size), peer, sapien)


if __name__ == "__main__":
    main()
