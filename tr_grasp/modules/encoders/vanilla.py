"""The Vanilla O-CNN of the thesis."""

from __future__ import annotations

from itertools import pairwise

from torch import Tensor, nn

from tr_grasp.modules.encoders.grid import GridOCNN, stage_channels
from tr_grasp.modules.encoders.norm import MOMENTUM, Norm
from tr_grasp.octree import NodeSet, Octree, OctreeConv, OctreePool, OctreeSpec


class VanillaOCNN(GridOCNN):
    """Convolution, ReLU, max pooling at each depth, then a fully connected layer on a 4 x 4 x 4 grid.

    At depth 4 this is the published network: 32 and 64 channels, 1 x 1 x 1 to 16, 160 features of the octree and 10 of
    the proprioception; 226,494 parameters with seven channels. A deeper octree adds a stage of twice the width.

    Args:
        spec, node_set, norm, norm_momentum, proprio: As for ``GridOCNN``; the published network has no ``norm``.

    Source: A. Orsula, drl_grasping 1.1.0, ``OctreeCnnFeaturesExtractor``.
    """

    def __init__(
        self,
        spec: OctreeSpec,
        node_set: NodeSet = "occupied",
        norm: Norm = "none",
        norm_momentum: float = MOMENTUM,
        proprio: bool = True,
    ) -> None:
        super().__init__(spec, node_set, norm, norm_momentum, proprio)
        channels = stage_channels(spec)
        widths = [spec.channels, *channels.values()]
        self.depths = tuple(channels)
        self.convs = nn.ModuleList(OctreeConv(a, b) for a, b in pairwise(widths))
        self.norms = nn.ModuleList(self._norm(width) for width in widths[1:])
        self.pool = OctreePool("max")
        self._make_heads(widths[-1])

    def _trunk(self, x: Tensor, octree: Octree) -> Tensor:
        for depth, conv, norm in zip(self.depths, self.convs, self.norms, strict=True):
            # ReLU and maximum commute; this order rectifies a quarter of the values.
            x = self.pool(norm(conv(x, octree, depth)), octree, depth).relu()
        return x
