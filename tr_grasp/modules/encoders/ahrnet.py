"""O-AHRNet of the thesis: a high-resolution network with attention, on octrees."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import reduce

import torch
from torch import Tensor, nn

from tr_grasp.modules.encoders.attention import OctreeAttention
from tr_grasp.modules.encoders.grid import FIRST_CHANNELS, GridOCNN
from tr_grasp.modules.encoders.norm import MOMENTUM, Norm
from tr_grasp.modules.encoders.residual import ResidualBlock
from tr_grasp.octree import NodeSet, Octree, OctreeConv, OctreeDeconv, OctreePool, OctreeSpec
from tr_grasp.octree.structure import FULL_DEPTH

Branches = dict[int, Tensor]
"""Depth to features ``(n, channels)`` of its nodes, the finest first."""

MakeNorm = Callable[[int], nn.Module]


class AttentionUnit(nn.Module):
    """Two 3 x 3 x 3 convolutions with attention behind them, plus the input."""

    def __init__(self, channels: int, norm: MakeNorm) -> None:
        super().__init__()
        self.convs = nn.ModuleList(OctreeConv(channels, channels) for _ in range(2))
        self.norms = nn.ModuleList(norm(channels) for _ in range(2))
        self.attention = OctreeAttention(channels)

    def forward(self, x: Tensor, octree: Octree, depth: int) -> Tensor:
        """``(n, channels)`` at ``depth`` to the same, not negative."""
        y = self.norms[0](self.convs[0](x, octree, depth)).relu()
        y = self.norms[1](self.convs[1](y, octree, depth))
        return (self.attention(y, octree, depth) + x).relu()


class Resample(nn.Module):
    """From one depth to another by strided or transposed convolutions, one a level, ReLU between them."""

    def __init__(self, depth: int, to_depth: int, channels: int, norm: MakeNorm) -> None:
        super().__init__()
        step = 1 if to_depth > depth else -1
        self.depths = range(depth, to_depth, step)
        self.convs = nn.ModuleList(
            OctreeDeconv(channels, channels) if step > 0 else OctreeConv(channels, channels, stride=2)
            for _ in self.depths
        )
        self.norms = nn.ModuleList(norm(channels) for _ in self.depths)

    def forward(self, x: Tensor, octree: Octree) -> Tensor:
        """``(n, channels)`` at the first depth to ``(m, channels)`` at the last."""
        for depth, conv, norm in zip(self.depths, self.convs, self.norms, strict=True):
            x = norm(conv(x if depth == self.depths[0] else x.relu(), octree, depth))
        return x


class Exchange(nn.Module):
    """Each branch that goes on is the sum of all that came, brought to its depth; then ReLU."""

    def __init__(self, depths: Iterable[int], to_depths: Iterable[int], channels: int, norm: MakeNorm) -> None:
        super().__init__()
        self.depths, self.to_depths = tuple(depths), tuple(to_depths)
        self.paths = nn.ModuleDict(
            {f"{a}to{b}": Resample(a, b, channels, norm) for b in self.to_depths for a in self.depths if a != b}
        )

    def forward(self, branches: Branches, octree: Octree) -> Branches:
        """Branches at ``depths`` to branches at ``to_depths``."""
        return {depth: self._fuse(branches, octree, depth).relu() for depth in self.to_depths}

    def _fuse(self, branches: Branches, octree: Octree, to_depth: int) -> Tensor:
        parts = [x if a == to_depth else self.paths[f"{a}to{to_depth}"](x, octree) for a, x in branches.items()]
        return reduce(torch.add, parts)


class OAHRNet(GridOCNN):
    """Parallel branches at depths 4, 3 and 2 that exchange what they see, each with attention.

    A residual block brings the leaves to 32 channels, the width of every branch. Stage s has s branches with one
    attention unit each, followed by an exchange with one more branch, the last among all. The branches are then pooled
    to depth 2 and laid side by side, and the network ends as the others do: 887,124 parameters with seven channels.
    An octree of another depth has a stage and a branch for each of its depths down to 2.

    The thesis gives no layer widths and many fit its number of parameters; this is the one that meets it best
    (-0.001 %) with every weight in use.

    Args:
        spec, node_set, norm, norm_momentum, proprio: As for ``GridOCNN``.

    Source: the thesis' O-AHRNet; Wang et al. 2020, HRNet, arXiv:1908.07919 (branches and exchanges).
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
        channels = FIRST_CHANNELS
        depths = tuple(range(spec.depth, FULL_DEPTH - 1, -1))
        self.stem = ResidualBlock(spec.channels, channels, self._norm)
        self.stages = nn.ModuleList()
        self.exchanges = nn.ModuleList()
        for branches_n in range(1, len(depths) + 1):
            here, there = depths[:branches_n], depths[: branches_n + 1]
            self.stages.append(nn.ModuleDict({str(depth): AttentionUnit(channels, self._norm) for depth in here}))
            self.exchanges.append(Exchange(here, there, channels, self._norm))
        self.pool = OctreePool("max")
        self._make_heads(channels * len(depths))

    def _trunk(self, x: Tensor, octree: Octree) -> Tensor:
        branches = {self.spec.depth: self.stem(x, octree, self.spec.depth)}
        for units, exchange in zip(self.stages, self.exchanges, strict=True):
            branches = {depth: units[str(depth)](x, octree, depth) for depth, x in branches.items()}  # type: ignore[index]
            branches = exchange(branches, octree)
        return torch.cat([self._to_grid(x, octree, depth) for depth, x in branches.items()], dim=1)

    def _to_grid(self, x: Tensor, octree: Octree, depth: int) -> Tensor:
        for d in range(depth, FULL_DEPTH, -1):
            x = self.pool(x, octree, d)
        return x
