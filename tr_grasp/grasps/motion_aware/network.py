"""Networks that say how likely a grasp holds on an object that moves: the thesis' and ours."""

from __future__ import annotations

from typing import Literal

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from tr_grasp.grasps.poses import Grasps

Array = NDArray[np.floating]
NetworkName = Literal["ours", "thesis"]
BACK_OFF_M = 0.075
"""Distance of the pre-grasp, which is an input of the thesis' network."""
LENGTH_M, SPEED_MPS = 0.1, 0.1
"""Units of our network's inputs."""


def inputs(kind: NetworkName, grasps: Grasps, velocity_mps: Array) -> Tensor:
    """(n, 16 or 19) what a network is told of grasps and velocities (n, 2) of the object, in the object's frame.

    Ours: position, approach direction, closing line without a sense (fingers are alike), opening, speed, direction as
    cosine and sine, and the velocity along the axes of the hand. The thesis: positions and quaternions of grasp and
    pre-grasp, the angle of the motion in radians, and the speed.
    """
    speed = np.linalg.norm(velocity_mps, axis=1, keepdims=True)
    angle = np.arctan2(velocity_mps[:, 1:], velocity_mps[:, :1])
    position, approach = grasps.position_m, grasps.approach()
    if kind == "thesis":
        before = position - BACK_OFF_M * approach
        rows = [position, grasps.q_wxyz, before, grasps.q_wxyz, angle, speed]
    else:
        R = grasps.poses()[:, :3, :3]
        first, second = np.triu_indices(3)
        line = R[:, first, 1] * R[:, second, 1]
        in_hand = np.einsum("nij,ni->nj", R[:, :2], velocity_mps) / SPEED_MPS
        # The hand that is turned by half about its approach direction is the same hand.
        in_hand[:, :2] = np.abs(in_hand[:, :2])
        rows = [
            position / LENGTH_M, approach, line, grasps.width_m[:, None] / LENGTH_M, speed / SPEED_MPS, np.cos(angle),
            np.sin(angle), in_hand,
        ]  # fmt: skip
    return torch.from_numpy(np.hstack(rows).astype(np.float32))


class QualityNet(nn.Module):
    """Two hidden layers; the logarithm of the odds that a grasp holds.

    Args:
        kind: ``thesis``: 16-512-512-2. ``ours``: 19-64-64-1, smooth.
    """

    def __init__(self, kind: NetworkName) -> None:
        super().__init__()
        self.kind: NetworkName = kind
        if kind == "thesis":
            self.layers = nn.Sequential(
                nn.Linear(16, 512), nn.ReLU(), nn.Linear(512, 512), nn.ReLU(), nn.Linear(512, 2)
            )
        else:
            self.layers = nn.Sequential(nn.Linear(19, 64), nn.SiLU(), nn.Linear(64, 64), nn.SiLU(), nn.Linear(64, 1))

    def forward(self, rows: Tensor) -> Tensor:
        """(n,) log odds for inputs (n, 16 or 19); a softmax over two outputs is the sigmoid of their difference."""
        out = self.layers(rows)
        return out[:, 1] - out[:, 0] if self.kind == "thesis" else out[:, 0]
