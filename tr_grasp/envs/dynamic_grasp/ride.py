"""The way of the carrier, known at every physics step."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray

from tr_grasp.prediction.motions import Motion

Array = NDArray[np.floating]


class Ride:
    """Poses of the middle of the carrier's top; its axes are those of the base at first.

    Args:
        path: A batch of one.
        timestep_s: Of the physics; between two steps the carrier is where it was at the nearest one.

    Attributes:
        duration_s: How long the path takes.
        velocity: (3,) [m/s] at the start.
        yaw_rate: [rad/s] at the start.
    """

    def __init__(self, path: Motion, timestep_s: float) -> None:
        self.duration_s = float(path.duration_s[0])
        self._timestep_s = timestep_s
        times = torch.arange(int(np.ceil(self.duration_s / timestep_s)) + 2, dtype=torch.float64) * timestep_s
        state = path.at(times.unsqueeze(-1))
        yaw = (state.yaw - state.yaw[0]).squeeze(-1).numpy()
        self._poses = np.tile(np.eye(4), (len(times), 1, 1))
        self._poses[:, 0, 0] = self._poses[:, 1, 1] = np.cos(yaw)
        self._poses[:, 1, 0] = np.sin(yaw)
        self._poses[:, 0, 1] = -np.sin(yaw)
        self._poses[:, :3, 3] = state.position[:, 0].numpy()
        self.velocity, self.yaw_rate = state.velocity[0, 0].numpy(), float(state.yaw_rate[0, 0])
        self._frozen_s = np.inf

    def freeze(self, now_s: float) -> None:
        """Stand still from now on."""
        self._frozen_s = min(self._frozen_s, now_s)

    def __call__(self, times_s: Array) -> Array:
        """``T_base_top`` (n, 4, 4) at times (n,)."""
        if len(times_s) == 1:  # at every step of the physics
            step = self._step(float(times_s[0]))
            return self._poses[step : step + 1]
        return self._poses[[self._step(float(time_s)) for time_s in times_s]]

    def _step(self, time_s: float) -> int:
        return min(max(round(min(time_s, self._frozen_s) / self._timestep_s), 0), len(self._poses) - 1)
