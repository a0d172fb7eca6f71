"""What every predictor does: take stamped measurements, refuse what cannot be one, look ahead from any time."""

from __future__ import annotations

import enum
import math
from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tr_grasp.errors import PredictionError
from tr_grasp.prediction.yaw import YawTracker

Array = NDArray[np.float64]


class Update(enum.Enum):
    """What became of a measurement."""

    TAKEN = "taken"
    LOST = "not finite; only its stamp counts"
    REPEATED = "its stamp came before; ignored"
    LATE = "older than one that came before; ignored"
    OUTLIER = "farther away than the target can have moved; set aside until the next one agrees"
    RESTARTED = "the target leaped, as the one before had said; everything older is forgotten"


@dataclass(frozen=True)
class GateCfg:
    """How far a target can move between two measurements; what goes farther is an outlier or a leap."""

    top_speed_m_s: float = 1.0
    """Fastest that a target moves."""
    slack_m: float = 0.05
    """Added to the way at that speed."""

    def passes(self, distance_m: float, time_s: float) -> bool:
        """Whether a target can have moved that far."""
        return distance_m <= self.slack_m + self.top_speed_m_s * time_s


@dataclass(frozen=True, eq=False)
class Prediction:
    """Where a target will be, at each of n horizons, in the frame of the measurements."""

    position: Array
    """(n, 3) Means [m]."""
    covariance: Array
    """(n, 3, 3) Of the true position [m²], symmetric and positive definite."""
    velocity: Array
    """(n, 3) [m/s]."""
    yaw: Array | None
    """(n,) [rad] in (-pi, pi]; None if no yaw was ever measured."""
    yaw_variance: Array | None
    """(n,) [rad²]."""
    yaw_rate: Array | None
    """(n,) [rad/s]."""


@dataclass(frozen=True, eq=False)
class Extrapolation:
    """Position part of a prediction."""

    position: Array
    covariance: Array
    velocity: Array


class Predictor(ABC):
    """A target's future from its stamped positions.

    Stamps may be irregular and measurements may be missing. What happens to one that is no good is the result of
    :meth:`update`; it never changes what the good ones told.

    Args:
        gate: What counts as a leap.
        yaw: How the heading is followed; at a constant rate by default.
    """

    def __init__(self, gate: GateCfg | None = None, yaw: YawTracker | None = None) -> None:
        self.gate = gate or GateCfg()
        self._yaw = yaw or YawTracker()
        self._forget_stamps()

    @property
    def newest_s(self) -> float | None:
        """Newest stamp that came; None before the first."""
        return self._newest_s

    def reset(self) -> None:
        """Forget every measurement."""
        self._forget_stamps()
        self._yaw.reset()

    def update(self, t: float, position: ArrayLike, yaw: float | None = None) -> Update:
        """Take a measurement.

        Args:
            t: When it was made [s], by any clock that goes forward.
            position: (3,) [m], in any fixed frame; NaN or infinity says that the target was not seen.
            yaw: Heading [rad], any number of turns; None or NaN if it was not measured.

        Returns:
            What became of it.

        Raises:
            PredictionError: A stamp that is not finite, or a position of another shape.
        """
        t, measured = _stamp("t", t), _position(position)
        if self._newest_s is not None and t <= self._newest_s:
            return Update.REPEATED if t == self._newest_s else Update.LATE
        self._newest_s = t
        if not np.isfinite(measured).all():
            return Update.LOST
        result = self._gated(t, measured)
        if result is Update.RESTARTED:
            self._yaw.reset()
        if result is not Update.OUTLIER and yaw is not None and math.isfinite(yaw):
            self._yaw.update(t, float(yaw))
        return result

    def predict(self, horizons_s: ArrayLike, now: float | None = None) -> Prediction:
        """Look ahead.

        Args:
            horizons_s: (n,) or a number: how long after ``now``, at least 0 [s].
            now: The present [s], on the clock of the stamps, so that the age of the last measurement counts; by default
                the newest stamp that came.

        Raises:
            PredictionError: No measurement yet, a horizon that is negative or not finite, or a present before the
                newest stamp.
        """
        if self._last is None or self._newest_s is None:
            raise PredictionError("there is nothing to predict from yet; call update(t, position) first.")
        now = self._newest_s if now is None else _stamp("now", now)
        if now < self._newest_s:
            raise PredictionError(f"now must not be before the newest stamp {self._newest_s}, got {now}.")
        horizons = np.atleast_1d(np.asarray(horizons_s, float))
        if horizons.ndim != 1 or not np.isfinite(horizons).all() or (horizons < 0).any():
            raise PredictionError(f"horizons_s must be a row of numbers, each at least 0, got {horizons.tolist()}.")
        found = self._extrapolate(horizons + (now - self._last[0]))
        heading = self._yaw.predict(now + horizons)
        return Prediction(found.position, found.covariance, found.velocity, *heading)

    def _gated(self, t: float, measured: Array) -> Update:
        if self._last is None:
            self._begin(measured)
            self._last = (t, measured)
            return Update.TAKEN
        if self._follows(self._last, t, measured):
            self._take(t - self._last[0], measured)
            self._last, self._leap = (t, measured), None
            return Update.TAKEN
        if self._leap is None or not self._follows(self._leap, t, measured):
            self._leap = (t, measured)
            return Update.OUTLIER
        since, self._leap = self._leap, None
        self._begin(since[1])
        self._take(t - since[0], measured)
        self._last = (t, measured)
        return Update.RESTARTED

    def _follows(self, before: tuple[float, Array], t: float, measured: Array) -> bool:
        return self.gate.passes(math.dist(measured, before[1]), t - before[0])

    def _forget_stamps(self) -> None:
        self._newest_s: float | None = None
        self._last: tuple[float, Array] | None = None
        self._leap: tuple[float, Array] | None = None

    @abstractmethod
    def _begin(self, measured: Array) -> None:
        """Start anew at a position (3,)."""

    @abstractmethod
    def _take(self, elapsed_s: float, measured: Array) -> None:
        """Take a position (3,), ``elapsed_s`` > 0 after the last."""

    @abstractmethod
    def _extrapolate(self, ahead_s: Array) -> Extrapolation:
        """Look (n,) times ahead of the last position."""


def _stamp(name: str, t: float) -> float:
    t = float(t)
    if not math.isfinite(t):
        raise PredictionError(f"{name} must be a finite time [s], got {t}.")
    return t


def _position(value: ArrayLike) -> Array:
    position = np.array(value, float)
    if position.shape != (3,):
        raise PredictionError(f"position must be (3,), got an array of shape {position.shape}.")
    return position
