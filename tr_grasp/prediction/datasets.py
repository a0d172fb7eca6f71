"""What predictors learn from: the thesis' windows, and situations of the filter bank on many motions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch
from torch import Generator, Tensor

from tr_grasp.prediction.hybrid import HybridPredictor
from tr_grasp.prediction.motions import Motion, MotionCfg, sample_motion
from tr_grasp.prediction.networks import PERIOD_S, WINDOW_N

SPEEDS_M_S = (0.01, 0.03, 0.05)
THESIS_MOTIONS = ("linear", "circular", "sinusoidal")
THESIS_TRAJECTORIES_N = 2000
THESIS_AHEAD_S = (1.2, 2.2)
"""After the newest position of the window: the thesis' code leaves 0.2 s between it and the present."""

_STEPS_AHEAD = tuple(round(seconds / PERIOD_S) for seconds in THESIS_AHEAD_S)
THESIS_CFG = MotionCfg(theta_deg=(0.0, 360.0), amplitude_share=0.5)
"""Ranges of the thesis' data: any direction, and sines half as high as they are far away."""


@dataclass(frozen=True, eq=False)
class Windows:
    """Windows of one trajectory, normalised to their oldest position as in the thesis; in order of time."""

    inputs: Tensor
    """(steps, 5, 3) float32 [m]."""
    targets: Tensor
    """(steps, 2, 3) float32 [m]: 1.2 and 2.2 s after the newest input."""

    @staticmethod
    def of(track: Tensor) -> Windows:
        """All windows of a track (times, 3), 0.2 s apart."""
        windows = track.unfold(0, WINDOW_N, 1).transpose(1, 2)[: len(track) - WINDOW_N - _STEPS_AHEAD[1] + 1]
        starts = torch.arange(len(windows)) + WINDOW_N - 1
        targets = torch.stack([track[starts + steps] for steps in _STEPS_AHEAD], 1)
        oldest = windows[:, :1]
        return Windows((windows - oldest).float(), (targets - oldest).float())


class WindowTable:
    """Windows of many trajectories, from which pieces are drawn: first a trajectory, each as likely, then where."""

    def __init__(self, tracks: list[Windows]) -> None:
        self._inputs = torch.cat([track.inputs for track in tracks])
        self._targets = torch.cat([track.targets for track in tracks])
        self._lengths = torch.tensor([len(track.inputs) for track in tracks])
        self._firsts = self._lengths.cumsum(0) - self._lengths

    def pieces(self, n: int, steps_n: int, generator: Generator) -> tuple[Tensor, Tensor]:
        """Inputs (n, steps, 5, 3) and targets (n, steps, 2, 3) of so many windows in a row, n times."""
        tracks = torch.randint(len(self._lengths), (n,), generator=generator)
        starts = torch.rand(n, generator=generator) * (self._lengths[tracks] - steps_n + 1)
        rows = (self._firsts[tracks] + starts.long())[:, None] + torch.arange(steps_n)
        return self._inputs[rows], self._targets[rows]


def thesis_tracks(motion: str, n: int, generator: Generator) -> list[Tensor]:
    """Noise-free tracks (times, 3), 0.2 s apart, from start to end, as the thesis' data sets: speeds 1, 3 or 5 cm/s."""
    speeds = torch.tensor(SPEEDS_M_S, dtype=torch.float64)[torch.randint(len(SPEEDS_M_S), (n,), generator=generator)]
    motions = sample_motion(motion, n, speed_m_s=speeds, generator=generator, cfg=THESIS_CFG)
    longest = float(motions.duration_s.max())
    times = torch.arange(round(longest / PERIOD_S), dtype=torch.float64).unsqueeze(-1) * PERIOD_S
    positions = motions.at(times).position
    ends = [round(float(duration) / PERIOD_S) for duration in motions.duration_s]
    return [positions[:end, index] for index, end in enumerate(ends)]


@dataclass(frozen=True, eq=False)
class Corrections:
    """Situations of the hybrid with the truth, in the frame of travel."""

    features: Tensor
    """(n, features) float32."""
    candidates: Tensor
    """(n, 3, 3) float32 [m]."""
    scale: Tensor
    """(n,) float32 [m]."""
    truth: Tensor
    """(n, 3) float32 [m]."""


HYBRID_MOTIONS: tuple[tuple[str, MotionCfg], ...] = (
    ("linear", MotionCfg()),
    ("linear_z", MotionCfg()),
    ("varying_speed", MotionCfg()),
    ("circular", MotionCfg(distance_m=(0.08, 0.7))),
    ("sinusoidal", MotionCfg(amplitude_m=(0.05, 0.35), wavelength_m=(0.2, 1.0))),
    ("sinusoidal", MotionCfg(amplitude_m=(0.03, 0.2), wavelength_m=(0.25, 0.6))),
    ("random_turns", MotionCfg()),
)
"""What the hybrid learns from; ``bezier`` and ``two_tone`` are never among it."""
HYBRID_SPEEDS_M_S = (0.01, 0.10)
HYBRID_HORIZON_S = 2.5
_LONGEST_S, _QUERIES_N, _HORIZONS_N = 15.0, 20, 4


def corrections(tracks_n: int, seed: int) -> Iterator[Corrections]:
    """Situations on random tracks, one track at a time.

    A track starts anywhere on a random motion at 1 to 10 cm/s, lasts up to 15 s, and is measured at 5 to 20 Hz, with up
    to 3 mm noise and up to 20 % drop-outs.
    """
    generator, rng = torch.Generator().manual_seed(seed), np.random.default_rng(seed)
    for _ in range(tracks_n):
        kind, cfg = HYBRID_MOTIONS[rng.integers(len(HYBRID_MOTIONS))]
        speed = float(rng.uniform(*HYBRID_SPEEDS_M_S))
        yield _corrections_on(sample_motion(kind, 1, speed_m_s=speed, generator=generator, cfg=cfg), rng)


def _corrections_on(motion: Motion, rng: np.random.Generator) -> Corrections:
    duration = float(motion.duration_s)
    start = rng.uniform(0.0, max(duration - 6.0, 0.1))
    end = min(start + _LONGEST_S, duration)
    times = np.arange(start, end, 1 / rng.choice([5, 10, 20]))
    noise = rng.choice([0.0, rng.uniform(0.0, 3e-3)])
    measured = _positions(motion, times) + rng.normal(0.0, 1.0, (len(times), 3)) * noise
    kept = rng.uniform(size=len(times)) > rng.choice([0.0, 0.2])
    kept[0] = True
    asked = set(rng.choice(len(times), min(_QUERIES_N, len(times)), replace=False).tolist())
    predictor, seen, later = HybridPredictor(weights=None), [], []
    for index in np.flatnonzero(kept):
        predictor.update(times[index], measured[index])
        if index in asked:
            horizons = rng.uniform(0.05, HYBRID_HORIZON_S, _HORIZONS_N)
            seen.append(predictor.situation(horizons))
            later.append(times[index] + horizons)
    truth = _positions(motion, np.concatenate(later)).reshape(-1, _HORIZONS_N, 3)
    columns = (
        [each.features for each in seen],
        [each.candidates for each in seen],
        [each.scale for each in seen],
        [(true - each.origin) @ each.R_base_travel for true, each in zip(truth, seen, strict=True)],
    )
    return Corrections(*(torch.from_numpy(np.concatenate(column)).float() for column in columns))


def _positions(motion: Motion, times: np.ndarray) -> np.ndarray:
    return motion.at(torch.from_numpy(np.asarray(times, float)).unsqueeze(-1)).position[:, 0].numpy()
