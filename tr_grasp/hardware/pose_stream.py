"""Poses as a tracking camera delivers them: at a rate, late, noisy, now and then missing."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from tr_grasp.errors import ConfigError
from tr_grasp.hardware.readings import Array, PoseReading

KEPT_N = 2000
EARLY_S = 1e-9


@dataclass(frozen=True)
class PoseStreamCfg:
    """Settings of :class:`PoseStream`.

    Raises:
        ConfigError: A rate that is not positive, a negative latency or noise, or a share outside [0, 1].
    """

    rate_hz: float = 30.0
    """Readings per second."""

    latency_s: float = 0.0
    """How long after it was true a reading arrives."""

    noise_m: float = 0.0
    """Standard deviation of the position, per axis."""

    noise_rad: float = 0.0
    """Standard deviation of the orientation, per axis."""

    dropout_share: float = 0.0
    """Part of the readings that never arrive."""

    seed: int = 0
    """Of noise and drop-outs."""

    def __post_init__(self) -> None:
        if not self.rate_hz > 0:
            raise ConfigError(f"pose_stream.rate_hz must be positive, got {self.rate_hz}")
        for name in ("latency_s", "noise_m", "noise_rad"):
            if not getattr(self, name) >= 0:
                raise ConfigError(f"pose_stream.{name} must not be negative, got {getattr(self, name)}")
        if not 0 <= self.dropout_share <= 1:
            raise ConfigError(f"pose_stream.dropout_share must be in [0, 1], got {self.dropout_share}")


class PoseStream:
    """Readings of one thing; what they say depends on the seed and the number of the reading alone."""

    def __init__(self, cfg: PoseStreamCfg | None = None) -> None:
        self.cfg = cfg or PoseStreamCfg()
        self._next = 0
        self._readings: deque[PoseReading] = deque(maxlen=KEPT_N)

    def is_due(self, now_s: float) -> bool:
        """Whether :meth:`observe` would make a reading now."""
        return now_s >= self._next / self.cfg.rate_hz - EARLY_S

    def observe(self, now_s: float, T_base_object: Array) -> None:
        """Tell where the thing is; call it at least as often as readings are due."""
        if not self.is_due(now_s):
            return
        number = int(np.floor(now_s * self.cfg.rate_hz + EARLY_S))
        self._next = number + 1
        rng = np.random.default_rng([self.cfg.seed, number])
        if rng.random() < self.cfg.dropout_share:
            return
        T = np.array(T_base_object, float)
        T[:3, 3] += self.cfg.noise_m * rng.normal(size=3)
        if self.cfg.noise_rad:
            T[:3, :3] = _rotation(self.cfg.noise_rad * rng.normal(size=3)) @ T[:3, :3]
        self._readings.append(PoseReading(now_s, T))

    def arrived(self, now_s: float, after_s: float = float("-inf")) -> tuple[PoseReading, ...]:
        """What has arrived by now and is stamped later than ``after_s``, oldest first."""
        newest = now_s - self.cfg.latency_s + EARLY_S
        return tuple(reading for reading in self._readings if after_s < reading.stamp_s <= newest)


def _rotation(vector: Array) -> Array:
    """(3, 3) about a rotation vector (3,)."""
    angle = float(np.linalg.norm(vector))
    x, y, z = vector / max(angle, 1e-12)
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * (K @ K)
