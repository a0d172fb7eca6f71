"""A heading that turns at a nearly constant rate, or does not turn."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class YawTracker:
    """A Kalman filter of heading and rate that goes on through ±pi.

    Args:
        turns: Whether to predict a turn; without it the last heading is kept, as the thesis does.
        sigma_rad: Standard deviation of a measurement.
        acceleration_density: Of the white angular acceleration [rad²/s³].
    """

    def __init__(self, turns: bool = True, sigma_rad: float = 0.01, acceleration_density: float = 1e-3) -> None:
        self.turns, self.sigma_rad, self.acceleration_density = turns, sigma_rad, acceleration_density
        self.reset()

    def reset(self) -> None:
        """Forget every measurement."""
        self._t: float | None = None
        self._x = np.zeros(2)
        self._P = np.zeros((2, 2))

    def update(self, t: float, yaw_rad: float) -> None:
        """Take a heading; ``t`` [s] is later than that of the last."""
        if self._t is None:
            self._x = np.array([yaw_rad, 0.0])
            self._P = np.diag([self.sigma_rad**2, 1.0])
        else:
            self._x, self._P = self._ahead(t - self._t)
            gain = self._P[:, 0] / (self._P[0, 0] + self.sigma_rad**2)
            self._x = self._x + gain * wrapped(yaw_rad - self._x[0])
            self._P = self._P - np.outer(gain, self._P[0])
            if not self.turns:
                self._x = np.array([yaw_rad, 0.0])
        self._t = t

    def predict(self, times_s: Array) -> tuple[Array, Array, Array] | tuple[None, None, None]:
        """Headings in (-pi, pi], variances and rates at absolute times (n,); None before the first measurement."""
        if self._t is None:
            return None, None, None
        ahead = [self._ahead(t - self._t) for t in times_s]
        yaw = np.array([wrapped(x[0]) for x, _ in ahead])
        return yaw, np.array([P[0, 0] for _, P in ahead]), np.array([x[1] for x, _ in ahead])

    def _ahead(self, dt: float) -> tuple[Array, Array]:
        F, q = np.array([[1.0, dt], [0.0, 1.0]]), self.acceleration_density
        Q = q * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
        return F @ self._x, F @ self._P @ F.T + Q


def wrapped(angle_rad: float) -> float:
    """The same angle in (-pi, pi]."""
    return -((-angle_rad + math.pi) % (2 * math.pi) - math.pi)
