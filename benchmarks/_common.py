"""Timing, rows and clouds for the benchmarks."""

from __future__ import annotations

import json
import os
import platform
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from tr_grasp.modules.encoders import default_spec
from tr_grasp.octree import OctreeFrame, OctreeSpec, octrees_from_clouds

SPEC = default_spec()

CLOCK = os.environ.get("TR_GRASP_BENCH_CLOCK", "wall")
"""``wall``, or ``cpu`` for the processor's time, which other work on the same cores disturbs less."""


def now_s() -> float:
    """Seconds on the clock that ``CLOCK`` names."""
    return time.process_time() if CLOCK == "cpu" else time.perf_counter()


class Timing(NamedTuple):
    """What calls took, and what the quickest took: on a busy machine the least disturbed one."""

    median_ms: float
    min_ms: float


def median_ms(*calls: Callable[[], Any], repeats: int = 15) -> list[float]:
    """Median time of each call, see :func:`timings`."""
    return [timing.median_ms for timing in timings(*calls, repeats=repeats)]


def timings(*calls: Callable[[], Any], repeats: int = 15) -> list[Timing]:
    """Time of each call. They take turns, so that another load on the machine falls on all alike."""
    times: list[list[float]] = [[] for _ in calls]
    for repeat in range(repeats + 2):
        for call, measured in zip(calls, times, strict=True):
            start = now_s()
            call()
            if torch.cuda.is_available():
                torch.cuda.synchronize()
            if repeat >= 2:  # the first two warm caches up
                measured.append((now_s() - start) * 1e3)
    return [Timing(median(measured), min(measured)) for measured in times]


def print_row(
    name: str, ms: float | Timing, peer: str | None = None, peer_ms: float | Timing | None = None, **more: Any
) -> None:
    """One JSON object on one line; ``ratio`` is how many times faster than the peer, by the medians."""
    row: dict[str, Any] = {"name": name, **_columns(ms)}
    if peer is not None and peer_ms is not None:
        row |= {"peer": peer, **{f"peer_{column}": value for column, value in _columns(peer_ms).items()}}
        row["ratio"] = round(row["peer_median_ms"] / row["median_ms"], 2)
    print(json.dumps(row | more | {"machine": machine()}), flush=True)


def _columns(ms: float | Timing) -> dict[str, float]:
    columns = ms._asdict() if isinstance(ms, Timing) else {"median_ms": ms}
    return {column: round(value, 3) for column, value in columns.items()}


def peak_mib(call: Callable[[], Any]) -> float:
    """Largest memory that torch's allocator held at once during the call, beyond what it held before.

    Counted from the profiler's record of every allocation and release on the CPU, and by the allocator itself on CUDA.
    What libraries below torch keep for themselves (oneDNN's workspace) is not in it.
    """
    call()  # tables that are made once do not count
    if torch.cuda.is_available():
        before = torch.cuda.memory_allocated()
        torch.cuda.reset_peak_memory_stats()
        call()
        return (torch.cuda.max_memory_allocated() - before) / 2**20
    with torch.profiler.profile(activities=[torch.profiler.ProfilerActivity.CPU], profile_memory=True) as profile:
        call()
    changes = [event for event in profile.profiler.kineto_results.events() if event.name() == "[memory]"]
    held = np.cumsum([event.nbytes() for event in sorted(changes, key=lambda event: event.start_ns())])
    return float(max(held.max(initial=0), 0)) / 2**20


def print_memory_row(
    name: str, mib: float, peer: str | None = None, peer_mib: float | None = None, **more: Any
) -> None:
    """One JSON object on one line; ``ratio`` is how many times less memory than the peer."""
    row: dict[str, Any] = {"name": name, "peak_mib": round(mib, 1)}
    if peer is not None and peer_mib is not None:
        row |= {"peer": peer, "peer_peak_mib": round(peer_mib, 1), "ratio": round(peer_mib / mib, 2)}
    print(json.dumps(row | more | {"machine": machine()}), flush=True)


def machine() -> str:
    """Processor, threads in use, torch version, and the clock if it is not the wall's."""
    processor = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        names = [line.split(":", 1)[1].strip() for line in cpuinfo.read_text().splitlines() if "model name" in line]
        processor = names[0] if names else processor
    clock = "" if CLOCK == "wall" else ", processor's time"
    return f"{processor}, {torch.get_num_threads()} thread(s), torch {torch.__version__}{clock}"


def tabletop_cloud(rng: np.random.Generator, points_n: int = 1500) -> tuple[NDArray[np.float32], ...]:
    """Points, normals, colours: a table and three boxes on it, seen from above."""
    table = np.concatenate([rng.uniform(-0.5, 0.5, (points_n // 2, 2)) * SPEC.side_m, np.zeros((points_n // 2, 1))], 1)
    points, normals = [table], [np.tile([0.0, 0.0, 1.0], (len(table), 1))]
    for _ in range(3):
        n = points_n // 6
        normal = np.eye(3)[rng.integers(0, 3, n)]
        on_box = np.where(normal == 1, 1.0, rng.uniform(-1, 1, (n, 3)))
        half = rng.uniform(0.015, 0.035, 3)
        points.append(on_box * half + np.r_[rng.uniform(-0.08, 0.08, 2), half[2]])
        normals.append(normal)
    xyz = np.concatenate(points) + np.r_[SPEC.centre_m[:2], 0.0]
    colours = rng.uniform(size=xyz.shape)
    return xyz.astype(np.float32), np.concatenate(normals).astype(np.float32), colours.astype(np.float32)


def tabletop_frames(frames_n: int, spec: OctreeSpec = SPEC) -> OctreeFrame:
    """Frames ``(frames_n,)`` of about 340 leaves."""
    rng = np.random.default_rng(0)
    return octrees_from_clouds([tabletop_cloud(rng) for _ in range(frames_n)], spec)
