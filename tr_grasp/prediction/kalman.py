"""Kalman filters with a polynomial in time behind them: constant velocity and constant acceleration."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import factorial
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from tr_grasp.errors import PredictionError
from tr_grasp.prediction.predictor import Array, Extrapolation, GateCfg, Predictor
from tr_grasp.prediction.yaw import YawTracker

THESIS_NOISE = 0.05
THESIS_MEASUREMENT_VARIANCE = 0.5

_FACTORIALS = np.array([factorial(n) for n in range(4)], float)
_LATER = np.arange(4)[None, :] - np.arange(4)[:, None]


@dataclass(frozen=True)
class KalmanCfg:
    """Noise of a Kalman filter."""

    process: Literal["white", "thesis"] = "white"
    """White noise on the highest derivative, scaled with the time between stamps; or the thesis' constant matrix."""
    density: float = 1e-5
    """Of that white noise: [m²/s⁵] on the jerk for constant acceleration, [m²/s³] for constant velocity."""
    sigma_m: float = 1e-3
    """Standard deviation of a measurement."""
    start_sigmas: tuple[float, float, float] = (1e-3, 0.1, 0.1)
    """Standard deviations of position, velocity and acceleration at the first measurement [m, m/s, m/s²]."""

    @staticmethod
    def thesis() -> KalmanCfg:
        """Values of the peer's code: P0 = I, R = 0.5 I m², Q = 0.05 in the whole block of positions and velocities."""
        return KalmanCfg(process="thesis", sigma_m=THESIS_MEASUREMENT_VARIANCE**0.5, start_sigmas=(1.0, 1.0, 1.0))


class KalmanPredictor(Predictor):
    """A Kalman filter that takes the acceleration for constant.

    The state is position, velocity and acceleration (9), the first position with zeros at the start.

    Args:
        cfg: Noise; tuned by default. With ``KalmanCfg.thesis()`` the values are those of the thesis, and the heading is
            kept, not predicted.
        gate: What counts as a leap.

    Raises:
        PredictionError: A noise that is not positive.
    """

    order = 3

    def __init__(self, cfg: KalmanCfg | None = None, gate: GateCfg | None = None) -> None:
        self.cfg = cfg or KalmanCfg()
        super().__init__(gate, YawTracker(turns=self.cfg.process == "white"))
        if not min(self.cfg.density, self.cfg.sigma_m, *self.cfg.start_sigmas) > 0:
            raise PredictionError(f"every noise of a Kalman filter must be positive, got {self.cfg}.")
        # Stamps are mostly as far apart as before.
        self._step = lru_cache(maxsize=256)(self._matrices)

    def _begin(self, measured: Array) -> None:
        self._x = np.concatenate([measured, np.zeros(3 * (self.order - 1))])
        self._P = np.diag(np.repeat(np.square(self.cfg.start_sigmas[: self.order]), 3))

    def _take(self, elapsed_s: float, measured: Array) -> None:
        F, Q = self._step(round(elapsed_s, 9))
        x, P = F @ self._x, F @ self._P @ F.T + Q
        # The measurement is the first three of the state, so H picks rows and columns.
        gain = P[:, :3] @ np.linalg.inv(P[:3, :3] + self.cfg.sigma_m**2 * np.eye(3))
        self._x = x + gain @ (measured - x[:3])
        P = P - gain @ P[:3]
        self._P = (P + P.T) / 2

    def _extrapolate(self, ahead_s: Array) -> Extrapolation:
        F, Q = self._matrices(ahead_s)
        x, P = F @ self._x, F @ self._P @ F.swapaxes(-1, -2) + Q
        return Extrapolation(x[:, :3], P[:, :3, :3], x[:, 3:6])

    def _matrices(self, dt: Array | float) -> tuple[Array, Array]:
        """Transition and process noise (*batch, states, states) over ``dt`` (*batch) [s]."""
        return on_three_axes(transition(self.order, dt)), self._process_noise(dt)

    def _process_noise(self, dt: Array | float) -> Array:
        if self.cfg.process == "white":
            return on_three_axes(white_noise(self.order, dt, self.cfg.density))
        Q = np.zeros((3 * self.order, 3 * self.order))
        Q[:6, :6] = THESIS_NOISE
        return Q * (np.asarray(dt)[..., None, None] > 0)


class ConstantVelocityPredictor(KalmanPredictor):
    """As :class:`KalmanPredictor`, with position and velocity (6) alone."""

    order = 2

    def __init__(self, cfg: KalmanCfg | None = None, gate: GateCfg | None = None) -> None:
        super().__init__(cfg or KalmanCfg(density=1e-4), gate)


def transition(order: int, dt: ArrayLike) -> Array:
    """How a polynomial's value and derivatives go on over ``dt`` (*batch) [s]: (*batch, order, order)."""
    power = _LATER[:order, :order]
    return np.where(
        power >= 0, np.asarray(dt, float)[..., None, None] ** power.clip(0) / _FACTORIALS[power.clip(0)], 0.0
    )


def white_noise(order: int, dt: ArrayLike, density: ArrayLike) -> Array:
    """What white noise on the derivative of that order adds over ``dt`` (*batch) [s]: (*batch, order, order)."""
    left = np.arange(order - 1, -1, -1)
    power = left[:, None] + left[None, :] + 1
    shares = 1 / (power * _FACTORIALS[left][:, None] * _FACTORIALS[left][None, :])
    return np.asarray(density)[..., None, None] * np.asarray(dt, float)[..., None, None] ** power * shares


def on_three_axes(matrices: Array) -> Array:
    """The same (*batch, n, n) for x, y and z: (*batch, 3 n, 3 n), as a Kronecker product with the identity."""
    n = matrices.shape[-1]
    blocks = matrices[..., :, None, :, None] * np.eye(3)[:, None, :]
    return blocks.reshape(*matrices.shape[:-2], 3 * n, 3 * n)
