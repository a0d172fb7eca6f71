"""The predictor that every other one has to beat."""

from __future__ import annotations

import numpy as np

from tr_grasp.prediction.predictor import Array, Extrapolation, GateCfg, Predictor
from tr_grasp.prediction.yaw import YawTracker


class HoldPredictor(Predictor):
    """The target stays where it was last seen, heading and all.

    Args:
        sigma_m: Standard deviation of a measurement.
        speed_m_s: Standard deviation of the speed, along each axis, that it may have after all.
        gate: What counts as a leap.
    """

    def __init__(self, sigma_m: float = 1e-3, speed_m_s: float = 0.03, gate: GateCfg | None = None) -> None:
        super().__init__(gate, YawTracker(turns=False))
        self.sigma_m, self.speed_m_s = sigma_m, speed_m_s

    def _begin(self, measured: Array) -> None:
        self._measured = measured

    def _take(self, elapsed_s: float, measured: Array) -> None:
        self._measured = measured

    def _extrapolate(self, ahead_s: Array) -> Extrapolation:
        variance = self.sigma_m**2 + (self.speed_m_s * ahead_s) ** 2
        covariance = variance[:, None, None] * np.eye(3)
        return Extrapolation(np.tile(self._measured, (len(ahead_s), 1)), covariance, np.zeros((len(ahead_s), 3)))
