"""From many blocks of an octree to one vector: where attention looks, how that is spread, and what is there."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from tr_grasp.octree import OctreeLevel

MOMENTS_N = 3

LOGIT_BOUND = 10.0
"""Logits stay within this, so that their exponentials need no shift by the largest."""

MOMENT_SCALE = 6.0
"""Brings the moments of a hand-sized object to the size of the other features."""


class SpatialReadout(nn.Module):
    """Attention heads that read positions, and the largest of every channel.

    Each head weighs all blocks of a sample (softmax) and reads the mean position, the second moments of two of its
    coordinates, which tell how the attended blocks are oriented, and the mean of learned values.

    Args:
        channels: Channels of a block.
        heads_n: Attention heads.
        values_n: Learned values that every head averages.
        positions_n: Coordinates of a block.
        plane: The two coordinates of which moments are read.
        central_moments: Moments about the attended mean; otherwise about the coordinates' origin, from which a network
            must work out the spread itself.
    """

    def __init__(
        self,
        channels: int,
        heads_n: int,
        values_n: int,
        positions_n: int = 5,
        plane: tuple[int, int] = (3, 4),
        central_moments: bool = True,
    ) -> None:
        super().__init__()
        self.positions_n = positions_n
        self.plane = plane
        self.central_moments = central_moments
        self.logits = nn.Linear(channels, heads_n)
        self.values = nn.Linear(channels, values_n)
        self.features_n = heads_n * (positions_n + MOMENTS_N + values_n) + channels

    def forward(self, blocks: Tensor, positions: Tensor, level: OctreeLevel) -> Tensor:
        """Features ``(B, features_n)`` of block channels ``(n, channels)``, not negative, and their positions.

        A sample without a block gets zeros.
        """
        weights = level.pad((LOGIT_BOUND * torch.tanh(self.logits(blocks) / LOGIT_BOUND)).exp())
        weights = weights / weights.sum(1, keepdim=True).clamp_min(torch.finfo(weights.dtype).tiny)

        # One padded copy serves the heads and the maximum; padding by zeros is harmless where nothing is negative.
        content = level.pad(torch.cat([positions, self._squares(positions), self.values(blocks), blocks], dim=1))
        averaged, blocks = content.split([content.shape[2] - blocks.shape[1], blocks.shape[1]], dim=2)
        read = torch.bmm(weights.transpose(1, 2), averaged)

        means_n = (self.positions_n, MOMENTS_N, self.values.out_features)
        mean, moments, values = read.split(means_n, dim=2)
        if self.central_moments:
            moments = moments - self._squares(mean)
        return torch.cat([torch.cat([mean, MOMENT_SCALE * moments, values], dim=2).flatten(1), blocks.amax(1)], dim=1)

    def _squares(self, positions: Tensor) -> Tensor:
        x, y = (positions[..., i] for i in self.plane)
        return torch.stack([x * x, x * y, y * y], dim=-1)


class MaxReadout(nn.Module):
    """The largest of every channel, and no position: what is left of ``SpatialReadout`` without attention.

    Args:
        channels: Channels of a block.
    """

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.features_n = channels

    def forward(self, blocks: Tensor, positions: Tensor, level: OctreeLevel) -> Tensor:
        """Features ``(B, channels)`` of block channels ``(n, channels)``, not negative; positions are not read."""
        return level.pad(blocks).amax(1)
