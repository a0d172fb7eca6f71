"""From many blocks of an octree to one vector: where attention looks, how that is spread, and what is there."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from tr_grasp.octree import OctreeLevel

OFFSETS_N = 5
"""Numbers that place a block relative to the gripper: offset in the base frame (3), along the tool's x and y (2)."""

MOMENTS_N = 3

LOGIT_BOUND = 10.0
"""Logits stay within this, so that their exponentials need no shift by the largest."""

MOMENT_SCALE = 6.0
"""Brings the moments of a hand-sized object to the size of the other features."""


class SpatialReadout(nn.Module):
    """Attention heads that read positions, and the largest of every channel.

    Each head weighs all blocks of a sample (softmax) and reads the mean offset, the central second moments along the
    tool's axes, which tell how the attended blocks are oriented, and the mean of learned values.

    Args:
        channels: Channels of a block.
        heads_n: Attention heads.
        values_n: Learned values that every head averages.
    """

    def __init__(self, channels: int, heads_n: int, values_n: int) -> None:
        super().__init__()
        self.logits = nn.Linear(channels, heads_n)
        self.values = nn.Linear(channels, values_n)
        self.features_n = heads_n * (OFFSETS_N + MOMENTS_N + values_n) + channels

    def forward(self, blocks: Tensor, offsets: Tensor, level: OctreeLevel) -> Tensor:
        """Features ``(B, features_n)`` of block channels ``(n, channels)``, not negative, and offsets ``(n, 5)``.

        A sample without a block gets zeros.
        """
        weights = level.pad((LOGIT_BOUND * torch.tanh(self.logits(blocks) / LOGIT_BOUND)).exp())
        weights = weights / weights.sum(1, keepdim=True).clamp_min(torch.finfo(weights.dtype).tiny)

        x, y = offsets[:, 3], offsets[:, 4]
        squares = torch.stack([x * x, x * y, y * y], dim=1)
        # One padded copy serves the heads and the maximum; padding by zeros is harmless where nothing is negative.
        content = level.pad(torch.cat([offsets, squares, self.values(blocks), blocks], dim=1))
        averaged, blocks = content.split([content.shape[2] - blocks.shape[1], blocks.shape[1]], dim=2)
        read = torch.bmm(weights.transpose(1, 2), averaged)

        mean, squares, values = read.split([OFFSETS_N, MOMENTS_N, read.shape[2] - OFFSETS_N - MOMENTS_N], dim=2)
        x, y = mean[..., 3], mean[..., 4]
        moments = MOMENT_SCALE * (squares - torch.stack([x * x, x * y, y * y], dim=2))
        return torch.cat([torch.cat([mean, moments, values], dim=2).flatten(1), blocks.amax(1)], dim=1)
