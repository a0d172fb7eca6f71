"""How good predictors are: distance to the truth, honesty of the covariance, time an update takes."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from torch import Generator

from tr_grasp.prediction.datasets import THESIS_AHEAD_S, thesis_tracks
from tr_grasp.prediction.networks import PERIOD_S, WINDOW_N
from tr_grasp.prediction.predictor import Predictor
from tr_grasp.prediction.tracks import Track
from tr_grasp.prediction.yaw import wrapped

Array = NDArray[np.float64]

PROBABLE_68 = 3.506
"""Squared Mahalanobis distance within which 68 % of a normal distribution in space lies."""
PROBABLE_95 = 7.815
"""The same for 95 %."""


@dataclass(frozen=True, eq=False)
class Scores:
    """Every prediction on some tracks."""

    horizons_s: tuple[float, ...]
    """Times ahead."""
    errors_m: Array
    """(predictions, horizons) Distance to the true position."""
    distances: Array
    """(predictions, horizons) Squared Mahalanobis distance of the true position."""
    yaw_errors_rad: Array
    """(predictions, horizons) Absolute error of the heading; NaN where none was measured."""
    update_us: Array
    """(updates,) Wall time of an update."""
    predict_us: Array
    """(predictions,) Wall time of a prediction at all horizons."""

    @property
    def mean_mm(self) -> Array:
        """(horizons,) Mean error."""
        return 1e3 * self.errors_m.mean(0)

    @property
    def p95_mm(self) -> Array:
        """(horizons,) What 95 % of the errors stay below."""
        return 1e3 * np.percentile(self.errors_m, 95, axis=0)

    @property
    def within_68(self) -> Array:
        """(horizons,) Share of true positions in the ellipsoid that should hold 68 %."""
        return (self.distances <= PROBABLE_68).mean(0)

    @property
    def within_95(self) -> Array:
        """(horizons,) Share in the one that should hold 95 %."""
        return (self.distances <= PROBABLE_95).mean(0)

    @staticmethod
    def joined(scores: Sequence[Scores]) -> Scores:
        """All of them as one."""
        columns = ("errors_m", "distances", "yaw_errors_rad", "update_us", "predict_us")
        return Scores(scores[0].horizons_s, *(np.concatenate([getattr(s, name) for s in scores]) for name in columns))


def score(predictor: Predictor, track: Track, horizons_s: Sequence[float], warm_up_s: float = 1.0) -> Scores:
    """Let a predictor see a track, and ask it after every measurement whose future is known to the last horizon.

    Args:
        predictor: Is reset first.
        track: What it sees.
        horizons_s: Times ahead.
        warm_up_s: Time after the first measurement in which it is not judged.
    """
    predictor.reset()
    horizons = np.array(horizons_s, float)
    asked, update_us, predict_us = [], [], []
    for index, t in enumerate(track.times):
        started = time.perf_counter()
        predictor.update(t, track.positions[index], None if track.yaws is None else track.yaws[index])
        update_us.append(1e6 * (time.perf_counter() - started))
        if t - track.times[0] < warm_up_s - 1e-9 or t + horizons.max() > track.end_s:
            continue
        started = time.perf_counter()
        prediction = predictor.predict(horizons)
        predict_us.append(1e6 * (time.perf_counter() - started))
        asked.append((t, prediction))
    n = len(horizons)
    times = np.array([t for t, _ in asked])[:, None] + horizons
    positions, yaws = track.truth(times.ravel())
    errors = positions.reshape(-1, n, 3) - np.array([found.position for _, found in asked]).reshape(-1, n, 3)
    covariances = np.array([found.covariance for _, found in asked]).reshape(-1, n, 3, 3)
    distances = (errors * np.linalg.solve(covariances, errors[..., None])[..., 0]).sum(-1)
    yaw_errors = np.full(distances.shape, np.nan)
    if yaws is not None:
        expected = np.array([np.full(n, np.nan) if found.yaw is None else found.yaw for _, found in asked])
        yaw_errors = np.abs(np.vectorize(wrapped, otypes=[float])(yaws.reshape(-1, n) - expected.reshape(-1, n)))
    norms = np.linalg.norm(errors, axis=-1)
    return Scores(tuple(horizons), norms, distances, yaw_errors, np.array(update_us), np.array(predict_us))


def thesis_loss(make: Callable[[], Predictor], motion: str, tracks_n: int, seed: int, warm_up_s: float = 0.0) -> float:
    """The thesis' validation loss [m²], on new tracks of its data set.

    Mean squared error an axis, 1.2 and 2.2 s after the newest position that the predictor was given, from the first
    full window on, and not before ``warm_up_s``. For the thesis' networks that is the loss that they were trained with.
    Slow tracks have more windows than fast ones, but as in the thesis' batches every track counts alike.
    """
    losses = []
    for track in thesis_tracks(motion, tracks_n, Generator().manual_seed(seed)):
        predictor, positions, squares = make(), track.numpy(), []
        steps = [round(ahead / PERIOD_S) for ahead in THESIS_AHEAD_S]
        for index, position in enumerate(positions[: -steps[-1]]):
            predictor.update(index * PERIOD_S, position)
            if index >= max(WINDOW_N - 1, warm_up_s / PERIOD_S - 1e-9):
                truth = positions[[index + step for step in steps]]
                squares.append(np.square(predictor.predict(THESIS_AHEAD_S).position - truth).mean())
        losses.append(np.mean(squares))
    return float(np.mean(losses))
