"""The backend that stores a row for each octant, so that nothing depends on what an octree holds but its numbers.

A level has ``batch * 8**depth`` rows in the order of their keys, whether there is a node or not, and a mask that says
where. The order of Morton codes puts the children of an octant next to each other: pooling, joining and upsampling are
views. Convolutions put the rows on a grid, by a constant table, and call PyTorch's. Leaves come in by a scatter of the
padded codes, and that is all: no operator asks how many nodes there are, so ``torch.export`` and ONNX can trace it, for
any batch, and nothing waits for a device.

Rows without a node hold anything finite. Every operator, ``pad`` and ``pool`` take them for absent, so a layer that
treats each row on its own (linear, ReLU, layer norm) need not know of them. What reduces over rows by itself must:
use ``octree_global_pool`` or ``OctreeLevel.pool``; the batch statistics of batch normalisation in training would count
them (its running ones, in evaluation, do not care). Like every octant, a row without a node has a sample and a cell.
So that means over children stay finite, ``children_n`` is 1 there.

The price is arithmetic at empty octants, most of all at the leaves.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import torch
import torch.nn.functional as F
from torch import Tensor

from tr_grasp.octree.morton import raster_order, raster_table
from tr_grasp.octree.structure import FULL_DEPTH, Backend, Octree, OctreeLevel, Pool


@dataclass(frozen=True, eq=False)
class DenseLevel(OctreeLevel):
    """All octants of one depth, and which of them are nodes."""

    mask: Tensor
    """bool ``(n, 1)``: whether there is a node."""

    def present(self, features: Tensor, fill: float = 0.0) -> Tensor:
        """The features, ``fill`` where there is no node."""
        return features.masked_fill(~self.mask, fill)

    def pad(self, features: Tensor) -> Tensor:
        """``(n, channels)`` as ``(batch, 8**depth, channels)``, zero where there is no node."""
        return self.present(features).view(self.batch_n, self.octants_n, -1)

    def pool(self, features: Tensor, kind: Pool = "max") -> Tensor:
        """``(n, channels)`` to ``(batch, channels)`` over the nodes of each sample; 0 for a sample without any."""
        return self._pool_groups(features, self.octants_n, kind)

    def pool_children(self, features: Tensor, kind: Pool) -> Tensor:
        """``(n, channels)`` to ``(n / 8, channels)`` over the nodes of each octant; 0 for one without any."""
        return self._pool_groups(features, 8, kind)

    def _pool_groups(self, features: Tensor, size: int, kind: Pool) -> Tensor:
        nodes_n = self.mask.view(-1, size).sum(1, keepdim=True)
        if kind == "average":
            sums = self.present(features).view(-1, size, features.shape[1]).sum(1)
            return sums / nodes_n.clamp_min(1).to(features.dtype)
        largest = self.present(features, -torch.inf).view(-1, size, features.shape[1]).amax(1)
        return largest.masked_fill(nodes_n == 0, 0)

    def to_grid(self, features: Tensor) -> Tensor:
        """``(n, channels)`` as ``(batch, channels, x, y, z)``, zero where there is no node."""
        order = raster_order(self.depth, features.device)
        grid = self.pad(features).index_select(1, order)
        # Channels stay innermost (channels_last_3d), which suits the convolutions and saves a transposition.
        return grid.view(self.batch_n, *[2**self.depth] * 3, -1).permute(0, 4, 1, 2, 3)

    def from_grid(self, grid: Tensor) -> Tensor:
        """``(batch, channels, x, y, z)`` as ``(n, channels)``."""
        rows = grid.permute(0, 2, 3, 4, 1).reshape(self.batch_n, self.octants_n, -1)
        return rows.index_select(1, raster_table(self.depth, 0, grid.device)).flatten(0, 1)


class DenseOctree(Octree):
    """``Octree`` with a row for each octant."""

    backend: ClassVar[Backend] = "dense"

    def _load(self, codes: Tensor, features: Tensor) -> None:
        octants_n = 8**self.depth
        # Padding goes to one more octant, which is cut off.
        places = torch.where(codes < 0, octants_n, codes.long())[..., None]
        mask = torch.zeros(self.batch_n, octants_n + 1, 1, dtype=features.dtype, device=codes.device)
        mask = mask.scatter(1, places, torch.ones_like(features[..., :1]))[:, :octants_n]
        grid = features.new_zeros(self.batch_n, octants_n + 1, features.shape[2])
        grid = grid.scatter(1, places.expand_as(features), features)[:, :octants_n]
        self._leaf_features = grid.flatten(0, 1)
        self._occupied = {self.depth: self._make(self.depth, mask.flatten(0, 1) > 0)}
        self._levels: dict[int, DenseLevel] = {}

    @property
    def leaves(self) -> DenseLevel:
        """All octants of the leaves' depth; the mask says which are leaves, whatever the node set."""
        return self._occupied[self.depth]

    def level(self, depth: int) -> DenseLevel:
        """All octants of this depth."""
        self._check_depth(depth)
        if self.node_set == "occupied":
            return self.occupied(depth)
        if depth not in self._levels:
            self._levels[depth] = self._make(depth, self._siblings(depth))
        return self._levels[depth]

    def occupied(self, depth: int) -> DenseLevel:
        """All octants of this depth; the mask says which hold a leaf, whatever the node set."""
        self._check_depth(depth)
        if depth not in self._occupied:
            finer = self.occupied(depth + 1).mask
            self._occupied[depth] = self._make(depth, finer.view(-1, 8).any(1, keepdim=True))
        return self._occupied[depth]

    def leaf_features(self, dtype: torch.dtype = torch.float32) -> Tensor:
        """``(batch * 8**depth, channels)``: stored features, zero where there is no leaf."""
        return self._leaf_features.to(dtype)

    def node_features(self, dtype: torch.dtype = torch.float32) -> Tensor:
        """``(batch * 8**depth, channels)``: stored features, zero where there is no leaf."""
        return self.leaf_features(dtype)

    def parents(self, depth: int) -> Tensor:
        """int64 ``(n,)``: row of each octant's parent among the octants of ``depth - 1``."""
        return self.level(depth).keys // 8

    def children_n(self, depth: int) -> Tensor:
        """int64 ``(n,)``: how many children of each octant are nodes; 1 where the octant itself is none."""
        children_n = self.level(depth + 1).mask.view(-1, 8).sum(1)
        return children_n.masked_fill(~self.level(depth).mask[:, 0], 1)

    def conv(self, features: Tensor, weight: Tensor, depth: int, stride: int) -> Tensor:
        """``octree_conv``: ``Conv3d`` on the grid."""
        level = self.level(depth)
        if len(weight) == 1 and stride == 1:
            return features @ weight[0]
        if len(weight) == 1:
            return level.present(features).view(-1, 8, features.shape[1])[:, 0] @ weight[0]
        grid = F.conv3d(level.to_grid(features), _kernel(weight, (4, 3)), stride=stride, padding=1)
        if stride == 1:
            return level.from_grid(grid)
        return self.level(depth - 1).from_grid(grid).masked_fill(~self._has_children(depth - 1), 0)

    def deconv(self, features: Tensor, weight: Tensor, depth: int) -> Tensor:
        """``octree_deconv``: ``ConvTranspose3d`` on the grid."""
        grid = self.level(depth).to_grid(features.masked_fill(~self._has_children(depth), 0))
        padding = 1 if len(weight) == 27 else 0
        grid = F.conv_transpose3d(grid, _kernel(weight, (3, 4)), stride=2, padding=padding, output_padding=1)
        return self.level(depth + 1).from_grid(grid)

    def pool(self, features: Tensor, depth: int, kind: Pool) -> Tensor:
        """``octree_pool``."""
        return self.level(depth).pool_children(features, kind)

    def upsample(self, features: Tensor, depth: int) -> Tensor:
        """``octree_upsample``."""
        return features[:, None].expand(-1, 8, -1).flatten(0, 1)

    def to_voxels(self, features: Tensor, depth: int) -> Tensor:
        """``octree_to_voxels``."""
        return self.level(depth).to_grid(features)

    def join_children(self, features: Tensor, depth: int) -> Tensor:
        """``octree_join_children``."""
        return self.level(depth).present(features).view(-1, 8 * features.shape[1])

    def _make(self, depth: int, mask: Tensor) -> DenseLevel:
        keys = torch.arange(self.batch_n * 8**depth, device=mask.device)
        return DenseLevel(depth, self.batch_n, keys, mask)

    def _siblings(self, depth: int) -> Tensor:
        if depth <= FULL_DEPTH:
            return torch.ones_like(self.occupied(depth).mask)
        return self.occupied(depth - 1).mask.expand(-1, 8).reshape(-1, 1)

    def _has_children(self, depth: int) -> Tensor:
        """Whether there is a node below, bool ``(n, 1)``."""
        return self.level(depth + 1).mask.view(-1, 8).any(1, keepdim=True)


def _kernel(weight: Tensor, channels: tuple[int, int]) -> Tensor:
    """``(taps, in, out)`` as PyTorch's kernels; ``channels`` orders 3 = in and 4 = out."""
    side = 3 if len(weight) == 27 else 1
    return weight.view(side, side, side, *weight.shape[1:]).permute(*channels, 0, 1, 2)
