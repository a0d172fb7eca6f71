"""The network of a reachability field: what it sees of a tool pose, and its layers."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import torch
from torch import Tensor, nn

from tr_grasp.motion import Kinematics

SOFT_RADIUS_M = 0.02
"""Directions relative to the radius fade within this distance of the base axis, where there is no radius."""
FULL_TURN_RAD = 2 * np.pi - 1e-3


@dataclass(frozen=True)
class ArmShape:
    """What features need to know of an arm.

    Attributes:
        wrist_tcp_m: The last joint in the tool's frame; it does not move against the tool.
        shoulder_m: Height of the second joint over the base.
        is_symmetric: The first joint turns all the way about the base's z axis, so that its azimuth does not matter.
    """

    wrist_tcp_m: tuple[float, float, float]
    shoulder_m: float
    is_symmetric: bool

    @classmethod
    def of(cls, kinematics: Kinematics) -> ArmShape:
        """Of an arm."""
        fixed = kinematics.chain.fixed
        x, y, z = (float(value) for value in -fixed[-1, :3, :3].T @ fixed[-1, :3, 3])
        upright = abs(fixed[0, 2, 2]) > 1 - 1e-6 and np.abs(fixed[0, :2, 3]).max() < 1e-6
        turns = kinematics.upper_rad[0] - kinematics.lower_rad[0] >= FULL_TURN_RAD
        return cls((x, y, z), float((fixed[0] @ fixed[1])[2, 3]), bool(upright and turns))

    @property
    def features_n(self) -> int:
        """Numbers that :meth:`features` gives."""
        return 14 if self.is_symmetric else 16

    def features(self, position: Tensor, rotation: Tensor) -> Tensor:
        """(b, features_n) of tool positions (b, 3) and rotations (b, 3, 3) in the base frame.

        Smooth functions of the rotation matrix, so that they agree wherever angles would jump; turning everything about
        the base axis changes none of them but the azimuth of an arm that is not symmetric.
        """
        wrist = position + rotation @ position.new_tensor(self.wrist_tcp_m)
        x, y, z = wrist[:, :1], wrist[:, 1:2], wrist[:, 2:]
        squared = x * x + y * y + SOFT_RADIUS_M**2
        radius = squared.sqrt()
        tool_radius = (position[:, :2].square().sum(1, keepdim=True) + SOFT_RADIUS_M**2).sqrt()
        ax, ay, az = rotation[:, 0], rotation[:, 1], rotation[:, 2]
        outward, sideways = (x * ax + y * ay) / radius, (x * ay - y * ax) / radius
        shoulder = (squared + (z - self.shoulder_m).square()).sqrt()
        rows = [radius, z, shoulder, tool_radius, position[:, 2:], az, outward, sideways]
        return torch.cat(rows if self.is_symmetric else [*rows, x / radius, y / radius], dim=1)


class MarginNet(nn.Module):
    """Three smooth layers.

    Args:
        shape: Of the arm.
        width: Of the layers.
    """

    mean: Tensor
    scale: Tensor

    def __init__(self, shape: ArmShape, width: int = 128) -> None:
        super().__init__()
        self.shape = shape
        self.register_buffer("mean", torch.zeros(shape.features_n))
        self.register_buffer("scale", torch.ones(shape.features_n))
        sizes = [shape.features_n, width, width, width]
        layers = [layer for n, m in pairwise(sizes) for layer in (nn.Linear(n, m), nn.SiLU())]
        self.layers = nn.Sequential(*layers, nn.Linear(width, 1))

    def forward(self, features: Tensor) -> Tensor:
        """(b,) margins [m] of features (b, features_n)."""
        return self.layers((features - self.mean) / self.scale)[:, 0]
