"""A baseline that sees the leaves as a set of points."""

from __future__ import annotations

from itertools import pairwise

import torch
from torch import Tensor, nn

from tr_grasp.modules.encoders.frames import merge_frames
from tr_grasp.modules.encoders.norm import MOMENTUM, Norm, norm_layer
from tr_grasp.modules.encoders.tool_frame import TOOL_FEATURES_N, tool_pose
from tr_grasp.octree import Backend, OctreeFrame, OctreeSpec


class PointNet(nn.Module):
    """The same MLP for the mean point of every leaf and its features, the largest of every channel, and an MLP.

    No leaf knows of its neighbours.

    Args:
        spec: The frames' octree.
        features_n: Features of a frame.
        norm: Normalisation in the MLP of the points, see :func:`~tr_grasp.modules.encoders.norm.norm_layer`.
        norm_momentum: Weight of a new batch in the running statistics of batch normalisation.

    Source: Qi et al. 2017, arXiv:1612.00593, without its learned transforms.
    """

    point_widths = (64, 64, 128)
    head_hidden_n = 256
    backend: Backend = "sparse"

    def __init__(
        self, spec: OctreeSpec, features_n: int = 128, norm: Norm = "none", norm_momentum: float = MOMENTUM
    ) -> None:
        super().__init__()
        self.spec = spec
        self.features_n = features_n
        normalise = norm_layer(norm, norm_momentum)
        layers = [
            nn.Sequential(nn.Linear(a, b), normalise(b), nn.ReLU())
            for a, b in pairwise((3 + spec.channels, *self.point_widths))
        ]
        self.describe = nn.Sequential(*layers)
        self.head = nn.Sequential(
            nn.Linear(self.point_widths[-1] + TOOL_FEATURES_N, self.head_hidden_n),
            nn.ReLU(),
            nn.Linear(self.head_hidden_n, features_n),
            nn.ReLU(),
        )

    def forward(self, frames: OctreeFrame, proprio: Tensor) -> Tensor:
        """Features ``(B, features_n)`` of frames with batch size ``(B,)`` and proprioception ``(B, 10)``."""
        octree = merge_frames(frames, self.spec, backend=self.backend)
        points = self.describe(torch.cat([octree.leaf_points(), octree.leaf_features()], dim=1))
        largest = octree.leaves.pool(points)
        return self.head(torch.cat([largest, tool_pose(proprio, self.spec).features], dim=1))
