"""What a predictor is judged on: measured tracks, with the truth about later times; generated, or from a file."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from tr_grasp.errors import PredictionError
from tr_grasp.prediction.motions import Motion, MotionCfg, sample_motion

Array = NDArray[np.float64]
COLUMNS = ("t", "x", "y", "z")


@dataclass(frozen=True)
class SensorCfg:
    """How targets are measured."""

    rate_hz: float = 5.0
    """Measurements a second; the benchmark has 5."""
    noise_m: float = 0.0
    """Standard deviation of a measurement, on each axis."""
    yaw_noise_rad: float = 0.0
    """Standard deviation of a measured heading."""
    lost_share: float = 0.0
    """Share of the measurements that never come."""


@dataclass(frozen=True, eq=False)
class Track:
    """Measurements of one target, and where it really was."""

    label: str
    """Kind of motion, or name of the file."""
    times: Array
    """(n,) Stamps [s], rising."""
    positions: Array
    """(n, 3) Measured [m]."""
    yaws: Array | None
    """(n,) Measured [rad]; None if they were not."""
    truth: Callable[[Array], tuple[Array, Array | None]]
    """True positions (m, 3) and headings (m,) at times (m,)."""
    end_s: float
    """Until then the truth is known."""


def generated_tracks(
    kind: str, n: int, *, speed_m_s: float, seed: int, sensor: SensorCfg | None = None, motion: MotionCfg | None = None
) -> list[Track]:
    """``n`` tracks of a kind of motion, from its start to its end.

    Raises:
        PredictionError: No such kind, or a sensor that measures nothing.
    """
    sensor = sensor or SensorCfg()
    if sensor.rate_hz <= 0 or min(sensor.noise_m, sensor.yaw_noise_rad) < 0 or not 0 <= sensor.lost_share < 1:
        raise PredictionError(f"a sensor needs a positive rate, noise of at least 0 and losses below 1, got {sensor}.")
    generator, rng = torch.Generator().manual_seed(seed), np.random.default_rng(seed)
    motions = sample_motion(kind, n, speed_m_s=speed_m_s, generator=generator, cfg=motion)
    return [_measured(motions[index], sensor, rng) for index in range(n)]


def read_track(path: Path) -> Track:
    """A track from a CSV file with the columns ``t,x,y,z`` and maybe ``yaw``, in s, m and rad.

    The truth is the track itself, with straight lines between its rows; so its noise counts as an error.

    Raises:
        PredictionError: No such file, missing columns, something that is no number, stamps that do not rise, or fewer
            than ten rows.
    """
    try:
        # Spreadsheets put a mark before the first column, which utf-8-sig drops.
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = list(csv.DictReader(file, skipinitialspace=True))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise PredictionError(f"the track '{path}' cannot be read: {error}.") from error
    head = rows[0].keys() if rows else ()
    if missing := [name for name in COLUMNS if name not in head]:
        raise PredictionError(f"the track '{path}' lacks {', '.join(missing)}: its columns must be t,x,y,z[,yaw].")
    names = [*COLUMNS, *(["yaw"] if "yaw" in head else [])]
    values = np.array([[_number(path, line, name, row[name]) for name in names] for line, row in enumerate(rows, 2)])
    if len(values) < 10:
        raise PredictionError(f"the track '{path}' has {len(values)} rows; at least 10 are needed.")
    times, positions = values[:, 0], values[:, 1:4]
    if (fall := np.flatnonzero(np.diff(times) <= 0)).size:
        raise PredictionError(f"the track '{path}': t must rise from row to row; it does not after {times[fall[0]]} s.")
    yaws = values[:, 4] if "yaw" in head else None

    def truth(asked: Array) -> tuple[Array, Array | None]:
        there = np.stack([np.interp(asked, times, axis) for axis in positions.T], -1)
        return there, None if yaws is None else np.interp(asked, times, np.unwrap(yaws))

    return Track(path.stem, times, positions, yaws, truth, float(times[-1]))


def _measured(motion: Motion, sensor: SensorCfg, rng: np.random.Generator) -> Track:
    end_s = float(motion.duration_s)
    times = np.arange(0.0, end_s, 1 / sensor.rate_hz)
    kept = rng.uniform(size=len(times)) >= sensor.lost_share
    kept[0] = True
    times = times[kept]

    def truth(asked: Array) -> tuple[Array, Array]:
        state = motion.at(torch.from_numpy(asked).unsqueeze(-1))
        return state.position[:, 0].numpy(), state.yaw[:, 0].numpy()

    positions, yaws = truth(times)
    positions = positions + rng.normal(0.0, 1.0, positions.shape) * sensor.noise_m
    yaws = yaws + rng.normal(0.0, 1.0, len(times)) * sensor.yaw_noise_rad
    return Track(motion.kind, times, positions, yaws, truth, end_s)


def _number(path: Path, line: int, name: str, text: str | None) -> float:
    try:
        value = float(text or "")
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise PredictionError(f"the track '{path}': {name} in line {line} must be a finite number, got {text!r}.")
    return value
