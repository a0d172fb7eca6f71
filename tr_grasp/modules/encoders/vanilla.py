"""The Vanilla O-CNN of the thesis."""

from __future__ import annotations

from itertools import pairwise

import torch
from torch import Tensor, nn

from tr_grasp.octree import NodeSet, Octree, OctreeConv, OctreeFrame, OctreePool, OctreeSpec, octree_to_voxels
from tr_grasp.octree.structure import FULL_DEPTH

PROPRIO_N = 10


class VanillaOCNN(nn.Module):
    """Convolution, ReLU, max pooling at each depth, then a fully connected layer on a 4 x 4 x 4 grid.

    At depth 4 this is the published network: 32 and 64 channels, 1 x 1 x 1 to 16, 160 features of the octree and 10 of
    the proprioception; 226,494 parameters with seven channels. A deeper octree adds a stage of twice the width.

    Args:
        spec: The frames' octree.
        node_set: ``siblings`` as published, or ``occupied``, which is faster.

    Source: A. Orsula, drl_grasping 1.1.0, ``OctreeCnnFeaturesExtractor``.
    """

    first_channels = 32
    voxel_channels = 16
    octree_features_n = 160

    def __init__(self, spec: OctreeSpec, node_set: NodeSet = "occupied") -> None:
        super().__init__()
        self.spec = spec
        self.node_set: NodeSet = node_set
        self.features_n = self.octree_features_n + PROPRIO_N

        depths = range(spec.depth, FULL_DEPTH, -1)
        widths = [spec.channels] + [self.first_channels * 2**stage for stage in range(len(depths))]
        self.depths = tuple(depths)
        self.convs = nn.ModuleList(OctreeConv(a, b) for a, b in pairwise(widths))
        self.pool = OctreePool("max")
        self.squeeze = nn.Linear(widths[-1], self.voxel_channels)
        self.octree_head = nn.Linear(self.voxel_channels * 8**FULL_DEPTH, self.octree_features_n)
        self.proprio_head = nn.Linear(PROPRIO_N, PROPRIO_N)

    def forward(self, frames: OctreeFrame, proprio: Tensor) -> Tensor:
        """Features ``(B, 170)`` of frames with batch size ``(B,)`` and proprioception ``(B, 10)``."""
        octree = Octree(frames, self.spec.depth, self.node_set)
        x = octree.node_features(proprio.dtype)
        for depth, conv in zip(self.depths, self.convs, strict=True):
            # ReLU and maximum commute; this order rectifies a quarter of the values.
            x = self.pool(conv(x, octree, depth), octree, depth).relu()
        voxels = octree_to_voxels(x, octree, FULL_DEPTH).permute(0, 2, 3, 4, 1)
        x = self.squeeze(voxels).relu().flatten(1)
        return torch.cat([self.octree_head(x), self.proprio_head(proprio)], dim=1).relu()
