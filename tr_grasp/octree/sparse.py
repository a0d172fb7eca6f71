"""The backend that stores a row for each node.

Every table is filled by indexing, none by sorting or searching; where something does not exist it holds the number of
nodes, the index of the zero row that the operators append. No operator scatters, forwards or backwards.
"""

from __future__ import annotations

from functools import cache, cached_property
from typing import ClassVar

import torch
from torch import Tensor

from tr_grasp.octree.frame import PADDING
from tr_grasp.octree.gather_conv import GatherConv
from tr_grasp.octree.morton import raster_table
from tr_grasp.octree.reads import Reads, adjoint_table, by_layers, in_one_part
from tr_grasp.octree.runs import Runs, Turns
from tr_grasp.octree.structure import FULL_DEPTH, Backend, Octree, OctreeLevel, Pool


class SparseLevel(OctreeLevel):
    """The nodes of one depth."""

    @cached_property
    def rows(self) -> Tensor:
        """int32 ``(batch * 8**depth,)``: row of every key in the list of nodes."""
        return self._rows_at(self.keys, self.batch_n * self.octants_n)

    @cached_property
    def neighbours(self) -> Tensor:
        """int32 ``(n, 27)``: rows of the nodes around each node, offsets in row-major order; 13 is the node itself."""
        return self.around(self)

    @cached_property
    def layered_neighbours(self) -> Reads:
        """``neighbours`` with the offsets of z slowest, by the layers of z that hold a node."""
        table = self.around(self, layered=True)
        # Elsewhere the numbers of rows would have to be waited for.
        return by_layers(table, self.nodes_n) if table.device.type == "cpu" else in_one_part(table)

    def around(self, centres: SparseLevel, scale: int = 1, layered: bool = False) -> Tensor:
        """int32 ``(centres, 27)``: rows of the nodes around ``scale`` times the cell of each centre.

        Offsets are in row-major order, z fastest; or, layered, z slowest.
        """
        padded_rows = self._padded_rows
        places = raster_table(self.depth, 1, self.keys.device)
        code = centres.codes if scale == 1 else centres.codes << 3
        start = places.index_select(0, code) + centres.samples * self._padded_octants_n
        around = start.int()[:, None] + _offsets(self.depth, layered, self.keys.device)
        return padded_rows.index_select(0, around.view(-1)).view(-1, 27)

    def pad(self, features: Tensor) -> Tensor:
        """``(n, channels)`` as ``(batch, most nodes of a sample, channels)``, filled up with zeros."""
        width, rows = self._padded_places
        padded = features.new_zeros(self.batch_n * width, features.shape[1])
        return padded.index_copy(0, rows, features).view(self.batch_n, width, -1)

    def pool(self, features: Tensor, kind: Pool = "max") -> Tensor:
        """``(n, channels)`` to ``(batch, channels)`` over the nodes of each sample; 0 for a sample without any."""
        return Runs(self._nodes_n_of_samples, self.samples).reduce(features, kind)

    @cached_property
    def _nodes_n_of_samples(self) -> Tensor:
        # By where each sample's keys begin, and not by a bincount, which waits for the device.
        borders = torch.arange(self.batch_n + 1, device=self.keys.device) * self.octants_n
        return torch.searchsorted(self.keys, borders).diff()

    @cached_property
    def _padded_places(self) -> tuple[int, Tensor]:
        counts = self._nodes_n_of_samples
        width = max(int(counts.max()), 1)  # at least one, or there would be nothing to reduce over
        first_rows = counts.cumsum(0) - counts
        in_sample = torch.arange(self.nodes_n, device=self.keys.device) - first_rows.index_select(0, self.samples)
        return width, in_sample + self.samples * width

    @property
    def _padded_octants_n(self) -> int:
        return (2**self.depth + 2) ** 3

    @cached_property
    def _padded_rows(self) -> Tensor:
        places = raster_table(self.depth, 1, self.keys.device).index_select(0, self.codes)
        places += self.samples * self._padded_octants_n
        return self._rows_at(places, self.batch_n * self._padded_octants_n)

    def _rows_at(self, places: Tensor, places_n: int) -> Tensor:
        rows = torch.full((places_n,), self.nodes_n, dtype=torch.int32, device=self.keys.device)
        return rows.index_copy_(0, places, torch.arange(self.nodes_n, dtype=torch.int32, device=self.keys.device))


class SparseOctree(Octree):
    """``Octree`` with a row for each node. The number of nodes is data, so making one waits for the device."""

    backend: ClassVar[Backend] = "sparse"

    def _load(self, codes: Tensor, features: Tensor) -> None:
        self._features = features
        self._occupied: dict[int, SparseLevel] = {}
        self._levels: dict[int, SparseLevel] = {}
        self._strided: dict[tuple[int, int], tuple[Reads, Reads]] = {}
        self._runs: dict[int, Runs] = {}
        self._occupied[self.depth], self.leaf_slots = self._find_leaves(codes)

    @property
    def leaves(self) -> SparseLevel:
        """The occupied leaves, whatever the node set."""
        return self._occupied[self.depth]

    def level(self, depth: int) -> SparseLevel:
        """Nodes of this depth."""
        self._check_depth(depth)
        if depth not in self._levels:
            self._levels[depth] = self._make_level(depth)
        return self._levels[depth]

    def occupied(self, depth: int) -> SparseLevel:
        """Octants of this depth that hold a leaf, whatever the node set."""
        self._check_depth(depth)
        if depth not in self._occupied:
            finer = self.occupied(depth + 1)
            present = torch.zeros(self.batch_n * 8**depth, dtype=torch.bool, device=finer.keys.device)
            present.index_fill_(0, finer.keys >> 3, True)
            self._occupied[depth] = SparseLevel(depth, self.batch_n, present.nonzero().view(-1))
        return self._occupied[depth]

    def leaf_features(self, dtype: torch.dtype = torch.float32) -> Tensor:
        """``(leaves, channels)``: stored features of the occupied leaves."""
        return self._features.flatten(0, 1).index_select(0, self.leaf_slots).to(dtype)

    def node_features(self, dtype: torch.dtype = torch.float32) -> Tensor:
        """``(n, channels)``: stored features of the finest nodes, zero in empty siblings."""
        features = self.leaf_features(dtype)
        if self.node_set == "occupied":
            return features
        level = self.level(self.depth)
        rows = level.rows.index_select(0, self.leaves.keys)
        return features.new_zeros(level.nodes_n, features.shape[1]).index_copy_(0, rows.long(), features)

    def parents(self, depth: int) -> Tensor:
        """int32 ``(n,)``: row of each node's parent among the nodes of ``depth - 1``."""
        return self.level(depth - 1).rows.index_select(0, self.level(depth).keys >> 3)

    def children(self, depth: int) -> Tensor:
        """int32 ``(n, 8)``: rows of each node's children among the nodes of ``depth + 1``."""
        return self.level(depth + 1).rows.view(-1, 8).index_select(0, self.level(depth).keys)

    def children_n(self, depth: int) -> Tensor:
        """int64 ``(n,)``: how many children of each node are nodes."""
        return (self.children(depth) < self.level(depth + 1).nodes_n).sum(1)

    def strided_tables(self, depth: int, taps: int) -> tuple[Reads, Reads]:
        """Nodes of ``depth`` that each node of ``depth - 1`` reads with stride 2, and the adjoint of that table.

        Both int32: ``(coarse, taps)`` and ``(fine, taps)``; 27 taps lie about the first child, 1 is the first child. A
        coarse node without children, among siblings, reads nothing and is not read (O-CNN).
        """
        if (depth, taps) not in self._strided:
            fine, coarse = self.level(depth), self.level(depth - 1)
            table = fine.around(coarse, scale=2) if taps == 27 else self.children(depth - 1)[:, :1]
            childless = self.children_n(depth - 1) == 0
            table = table.masked_fill(childless[:, None], fine.nodes_n)
            self._strided[depth, taps] = in_one_part(table), in_one_part(adjoint_table(table, fine.nodes_n))
        return self._strided[depth, taps]

    def child_slots(self, depth: int) -> Tensor:
        """int64 ``(n,)``: ``8 * parent's row + octant`` of each node, its place among its parents' children."""
        return self.parents(depth).long() * 8 + (self.level(depth).keys & 7)

    def conv(self, features: Tensor, weight: Tensor, depth: int, stride: int) -> Tensor:
        """``octree_conv``: a gather and a matrix product."""
        if stride == 2:
            return GatherConv.apply(features, weight, *self.strided_tables(depth, len(weight)))
        if len(weight) == 1:
            return features @ weight[0]
        layered = weight.view(9, 3, *weight.shape[1:]).transpose(0, 1).reshape(weight.shape)  # z slowest
        return GatherConv.apply(features, layered, self.level(depth).layered_neighbours, None)

    def deconv(self, features: Tensor, weight: Tensor, depth: int) -> Tensor:
        """``octree_deconv``: the strided convolution with its two tables exchanged."""
        table, adjoint = self.strided_tables(depth + 1, len(weight))
        return GatherConv.apply(features, weight, adjoint, table)

    def pool(self, features: Tensor, depth: int, kind: Pool) -> Tensor:
        """``octree_pool``."""
        return self._siblings(depth).reduce(features, kind)

    def upsample(self, features: Tensor, depth: int) -> Tensor:
        """``octree_upsample``."""
        return self._siblings(depth + 1).spread(features)

    def to_voxels(self, features: Tensor, depth: int) -> Tensor:
        """``octree_to_voxels``."""
        level = self.level(depth)
        grid = features.new_zeros(self.batch_n * level.octants_n, features.shape[1])
        grid = grid.index_copy(0, level.raster, features)
        return grid.view(self.batch_n, *[2**depth] * 3, -1).permute(0, 4, 1, 2, 3)

    def join_children(self, features: Tensor, depth: int) -> Tensor:
        """``octree_join_children``."""
        parents_n = self.level(depth - 1).nodes_n
        channels = features.shape[1]
        joined = features.new_zeros(parents_n * 8, channels)
        return joined.index_copy(0, self.child_slots(depth), features).view(parents_n, 8 * channels)

    def _find_leaves(self, codes: Tensor) -> tuple[SparseLevel, Tensor]:
        slots = (codes != PADDING).view(-1).nonzero().view(-1)
        first_keys = torch.arange(self.batch_n, device=codes.device)[:, None] * 8**self.depth
        keys = (codes + first_keys).view(-1).index_select(0, slots)
        slot_of_key = torch.full((self.batch_n * 8**self.depth,), -1, dtype=torch.int64, device=codes.device)
        slot_of_key.index_copy_(0, keys, slots)
        ascending = (slot_of_key >= 0).nonzero().view(-1)
        return SparseLevel(self.depth, self.batch_n, ascending), slot_of_key.index_select(0, ascending)

    def _siblings(self, depth: int) -> Runs:
        """The nodes of ``depth``; those of one parent are neighbours in the list."""
        if depth not in self._runs:
            # Where nodes are what holds a leaf, something below holds it too.
            some_are_empty = self.node_set == "siblings"
            lengths = self.children_n(depth - 1)
            turns = Turns.of(lengths) if lengths.device.type == "cpu" else None
            self._runs[depth] = Runs(lengths, self.parents(depth), some_are_empty, turns)
        return self._runs[depth]

    def _make_level(self, depth: int) -> SparseLevel:
        if self.node_set == "occupied":
            return self.occupied(depth)
        device = self.leaves.keys.device
        if depth <= FULL_DEPTH:
            return SparseLevel(depth, self.batch_n, torch.arange(self.batch_n * 8**depth, device=device))
        keys = self.occupied(depth - 1).keys[:, None] * 8 + torch.arange(8, device=device)
        return SparseLevel(depth, self.batch_n, keys.view(-1))


@cache
def _offsets(depth: int, layered: bool, device: torch.device) -> Tensor:
    """int32 ``(27,)``: steps to the neighbours in a padded row-major grid."""
    side = 2**depth + 2
    strides = torch.tensor([1, side * side, side] if layered else [side * side, side, 1])
    return (torch.cartesian_prod(*[torch.arange(-1, 2)] * 3) @ strides).int().to(device)
