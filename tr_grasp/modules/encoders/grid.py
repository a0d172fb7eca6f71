"""What the octree networks of the thesis share: how they end."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor, nn

from tr_grasp.errors import ConfigError, unknown_name
from tr_grasp.modules.encoders.frames import merge_frames
from tr_grasp.modules.encoders.norm import Norm, norm_layer
from tr_grasp.octree import Backend, NodeSet, Octree, OctreeFrame, OctreeSpec, octree_to_voxels
from tr_grasp.octree.structure import FULL_DEPTH, NODE_SETS

PROPRIO_N = 10

FIRST_CHANNELS = 32
"""Channels at the depth of the leaves."""


class GridOCNN(nn.Module):
    """Some network down to depth 2, then a fully connected layer on the 4 x 4 x 4 grid, beside the proprioception.

    A subclass makes its layers, calls ``_make_heads`` with their last width, and computes it in ``_trunk``. Widths are
    those of the thesis; only 3 x 3 x 3 convolutions and what precedes a sum have no bias.

    Args:
        spec: The frames' octree.
        node_set: ``siblings`` as published, or ``occupied``, which is faster.
        norm: Normalisation after every convolution, see :func:`~tr_grasp.modules.encoders.norm.norm_layer`.
        norm_momentum: Weight of a new batch in the running statistics of batch normalisation.
        proprio: Append features of the proprioception.

    Source: A. Orsula, drl_grasping 1.1.0, ``OctreeCnnFeaturesExtractor``.
    """

    voxel_channels = 16
    octree_features_n = 160
    backend: Backend = "sparse"

    def __init__(self, spec: OctreeSpec, node_set: NodeSet, norm: Norm, norm_momentum: float, proprio: bool) -> None:
        super().__init__()
        if node_set not in NODE_SETS:
            raise ConfigError(unknown_name("node set", node_set, NODE_SETS))
        self.spec = spec
        self.node_set: NodeSet = node_set
        self.features_n = self.octree_features_n + (PROPRIO_N if proprio else 0)
        self._norm: Callable[[int], nn.Module] = norm_layer(norm, norm_momentum)
        self._proprio = proprio

    def _make_heads(self, channels: int) -> None:
        self.squeeze = nn.Linear(channels, self.voxel_channels)
        self.squeeze_norm = self._norm(self.voxel_channels)
        self.octree_head = nn.Linear(self.voxel_channels * 8**FULL_DEPTH, self.octree_features_n)
        if self._proprio:
            self.proprio_head = nn.Linear(PROPRIO_N, PROPRIO_N)

    def _trunk(self, x: Tensor, octree: Octree) -> Tensor:
        """``(n, channels)`` at depth 2 of the leaves' features ``(m, spec.channels)``."""
        raise NotImplementedError

    def forward(self, frames: OctreeFrame, proprio: Tensor) -> Tensor:
        """Features ``(B, features_n)`` of frames with batch size ``(B,)`` and proprioception ``(B, 10)``."""
        octree = merge_frames(frames, self.spec, self.node_set, self.backend)
        x = self._trunk(octree.node_features(proprio.dtype), octree)
        voxels = octree_to_voxels(x, octree, FULL_DEPTH).permute(0, 2, 3, 4, 1)
        x = self.squeeze_norm(self.squeeze(voxels).flatten(0, 3)).relu()
        features = self.octree_head(x.view(-1, self.octree_head.in_features))
        if self._proprio:
            features = torch.cat([features, self.proprio_head(proprio)], dim=1)
        return features.relu()


def stage_channels(spec: OctreeSpec) -> dict[int, int]:
    """Width of the stage at each depth, from the leaves down to depth 3: 32, and twice as much each time."""
    return {depth: FIRST_CHANNELS << spec.depth - depth for depth in range(spec.depth, FULL_DEPTH, -1)}
