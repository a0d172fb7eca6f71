"""Which channels and which nodes matter: attention for the features of an octree."""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn

from tr_grasp.octree import Octree, OctreeConv


class OctreeAttention(nn.Module):
    """Weigh the channels of each sample, then its nodes.

    Channels: the largest and the mean of every channel over a sample's nodes pass through one shared convolution over
    neighbouring channels, are added, and a sigmoid makes weights of them. Nodes: the largest and the mean of every
    node's weighted channels pass through a 3 x 3 x 3 octree convolution and a sigmoid. No biases: kernel + 54
    parameters.

    Args:
        channels: Channels of a node.

    Source: Wang et al. 2020, ECA-Net, arXiv:1910.03151 (channels); Woo et al. 2018, CBAM, arXiv:1807.06521 (both
    poolings, their sum, and the attention over places).
    """

    def __init__(self, channels: int) -> None:
        super().__init__()
        kernel = channel_kernel(channels)
        self.channel_conv = nn.Conv1d(1, 1, kernel, padding=kernel // 2, bias=False)
        self.node_conv = OctreeConv(2, 1)

    def forward(self, x: Tensor, octree: Octree, depth: int) -> Tensor:
        """``(n, channels)`` at ``depth``, weighted."""
        level = octree.level(depth)
        pooled = self.channel_conv(torch.cat([level.pool(x, "max"), level.pool(x, "average")])[:, None])
        channel_weights = torch.sigmoid(pooled[: level.batch_n, 0] + pooled[level.batch_n :, 0])
        x = x * channel_weights.to(x.dtype).index_select(0, level.samples)
        summary = torch.stack([x.amax(1), x.mean(1)], dim=1)
        return x * torch.sigmoid(self.node_conv(summary, octree, depth))


def channel_kernel(channels: int) -> int:
    """Neighbouring channels that weigh each other: 3 for 16 to 64 channels, 5 for 128 and 256.

    The odd number nearest to ``(log2(channels) + 1) / 2``, as in ECA-Net with gamma = 2 and b = 1.
    """
    kernel = int((math.log2(channels) + 1) / 2)
    return kernel if kernel % 2 else kernel + 1
