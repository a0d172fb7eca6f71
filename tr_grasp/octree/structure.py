"""A batch of frames merged into one octree, with the tables that the operators read.

Nodes of all samples share one list per depth, ordered by key = ``code + 8**depth * sample``. Every table is filled by
indexing, none by sorting or searching; where something does not exist it holds the number of nodes, the index of the
zero row that the operators append.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from typing import Literal

import torch
from torch import Tensor

from tr_grasp.errors import ConfigError, unknown_name
from tr_grasp.octree.frame import PADDING, OctreeFrame
from tr_grasp.octree.gather_conv import adjoint_table
from tr_grasp.octree.morton import cell_table, raster_table
from tr_grasp.octree.spec import HALF_DIAGONAL

NodeSet = Literal["occupied", "siblings"]
NODE_SETS = ("occupied", "siblings")

FULL_DEPTH = 2
"""Depth down to which the node set ``siblings`` holds every octant, as in O-CNN."""


@dataclass(frozen=True, eq=False)
class OctreeLevel:
    """The nodes of one depth, in ascending order of their keys."""

    depth: int
    batch_n: int
    keys: Tensor
    """int64 ``(n,)``: ``code + 8**depth * sample``."""

    @property
    def nodes_n(self) -> int:
        """Number of nodes, all samples together."""
        return len(self.keys)

    @property
    def octants_n(self) -> int:
        """Octants of one sample at this depth, present or not."""
        return 8**self.depth

    @cached_property
    def samples(self) -> Tensor:
        """int64 ``(n,)``: the sample that a node belongs to."""
        return self.keys >> 3 * self.depth

    @cached_property
    def codes(self) -> Tensor:
        """int64 ``(n,)``: Morton codes."""
        return self.keys & (self.octants_n - 1)

    @cached_property
    def cells(self) -> Tensor:
        """int64 ``(n, 3)``: x, y, z of each node, in cells of this depth."""
        return cell_table(self.depth, self.keys.device).index_select(0, self.codes)

    @cached_property
    def rows(self) -> Tensor:
        """int32 ``(batch * 8**depth,)``: row of every key in the list of nodes."""
        return self._rows_at(self.keys, self.batch_n * self.octants_n)

    @cached_property
    def raster(self) -> Tensor:
        """int64 ``(n,)``: index of each node in a row-major ``(batch, x, y, z)`` grid."""
        in_sample = raster_table(self.depth, 0, self.keys.device).index_select(0, self.codes)
        return in_sample + self.samples * self.octants_n

    @cached_property
    def neighbours(self) -> Tensor:
        """int32 ``(n, 27)``: rows of the nodes around each node, offsets in row-major order; 13 is the node itself."""
        return self.around(self)

    def around(self, centres: OctreeLevel, scale: int = 1) -> Tensor:
        """int32 ``(centres, 27)``: rows of the nodes around ``scale`` times the cell of each centre."""
        padded_rows = self._padded_rows
        places = raster_table(self.depth, 1, self.keys.device)
        code = centres.codes if scale == 1 else centres.codes << 3
        start = places.index_select(0, code) + centres.samples * self._padded_octants_n
        around = start.int()[:, None] + _offsets(self.depth, self.keys.device)
        return padded_rows.index_select(0, around.view(-1)).view(-1, 27)

    def pad(self, features: Tensor) -> Tensor:
        """``(n, channels)`` as ``(batch, most nodes of a sample, channels)``, filled up with zeros."""
        width, rows = self._padded_places
        padded = features.new_zeros(self.batch_n * width, features.shape[1])
        return padded.index_copy(0, rows, features).view(self.batch_n, width, -1)

    @cached_property
    def _padded_places(self) -> tuple[int, Tensor]:
        counts = torch.bincount(self.samples, minlength=self.batch_n)
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


class Octree:
    """Octrees of a batch of frames, merged.

    Args:
        frames: Batch size ``(B,)``; codes in any order, padding anywhere.
        depth: Depth of the frames' leaves.
        node_set: ``occupied``: nodes are the octants that hold a leaf. ``siblings``: all eight children of every
            octant that holds a leaf, and every octant down to depth 2 (O-CNN).

    Raises:
        ConfigError: If ``node_set`` does not exist.
        ValueError: If the frames have more than one batch dimension.
    """

    def __init__(self, frames: OctreeFrame, depth: int, node_set: NodeSet = "occupied") -> None:
        if node_set not in NODE_SETS:
            raise ConfigError(unknown_name("node set", node_set, NODE_SETS))
        if frames.batch_dims != 1:
            raise ValueError(f"frames must have batch size (B,), got {tuple(frames.batch_size)}.")
        self.depth = depth
        self.node_set = node_set
        self.batch_n = len(frames.codes)
        self._features = frames.features
        self._occupied: dict[int, OctreeLevel] = {}
        self._levels: dict[int, OctreeLevel] = {}
        self._strided: dict[tuple[int, int], tuple[Tensor, Tensor]] = {}
        self._occupied[depth], self.leaf_slots = self._find_leaves(frames.codes)

    @property
    def leaves(self) -> OctreeLevel:
        """The occupied leaves, whatever the node set."""
        return self._occupied[self.depth]

    def level(self, depth: int) -> OctreeLevel:
        """Nodes of this depth."""
        if depth not in self._levels:
            self._levels[depth] = self._make_level(depth)
        return self._levels[depth]

    def occupied(self, depth: int) -> OctreeLevel:
        """Octants of this depth that hold a leaf, whatever the node set."""
        if depth not in self._occupied:
            finer = self.occupied(depth + 1)
            present = torch.zeros(self.batch_n * 8**depth, dtype=torch.bool, device=finer.keys.device)
            present.index_fill_(0, finer.keys >> 3, True)
            self._occupied[depth] = OctreeLevel(depth, self.batch_n, present.nonzero().view(-1))
        return self._occupied[depth]

    def leaf_features(self, dtype: torch.dtype = torch.float32) -> Tensor:
        """``(leaves, channels)``: stored features of the occupied leaves."""
        return self._features.flatten(0, 1).index_select(0, self.leaf_slots).to(dtype)

    def leaf_points(self) -> Tensor:
        """float32 ``(leaves, 3)``: mean point of each leaf as far as it is known, in units of the cube.

        The cube's centre is the origin and half its edge is 1. The point is put at the stored distance from the
        cell's centre along the mean normal, which is exact for a plane.
        """
        features = self.leaf_features()
        leaf = 2 / 2**self.depth
        centres = (self.leaves.cells + 0.5) * leaf - 1
        return centres + features[:, :3] * features[:, 3:4] * (leaf * HALF_DIAGONAL)

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

    def strided_tables(self, depth: int, taps: int) -> tuple[Tensor, Tensor]:
        """Nodes of ``depth`` that each node of ``depth - 1`` reads with stride 2, and the adjoint of that table.

        Both int32: ``(coarse, taps)`` and ``(fine, taps)``; 27 taps lie about the first child, 1 is the first child. A
        coarse node without children, among siblings, reads nothing and is not read (O-CNN).
        """
        if (depth, taps) not in self._strided:
            fine, coarse = self.level(depth), self.level(depth - 1)
            table = fine.around(coarse, scale=2) if taps == 27 else self.children(depth - 1)[:, :1]
            childless = self.children_n(depth - 1) == 0
            table = table.masked_fill(childless[:, None], fine.nodes_n)
            self._strided[depth, taps] = table, adjoint_table(table, fine.nodes_n)
        return self._strided[depth, taps]

    def child_slots(self, depth: int) -> Tensor:
        """int64 ``(n,)``: ``8 * parent's row + octant`` of each node, its place among its parents' children."""
        return self.parents(depth).long() * 8 + (self.level(depth).keys & 7)

    def _find_leaves(self, codes: Tensor) -> tuple[OctreeLevel, Tensor]:
        capacity = codes.shape[1]
        slots = (codes != PADDING).view(-1).nonzero().view(-1)
        keys = codes.reshape(-1).index_select(0, slots).long() + (slots // capacity) * 8**self.depth
        slot_of_key = torch.full((self.batch_n * 8**self.depth,), -1, dtype=torch.int64, device=codes.device)
        slot_of_key.index_copy_(0, keys, slots)
        ascending = (slot_of_key >= 0).nonzero().view(-1)
        return OctreeLevel(self.depth, self.batch_n, ascending), slot_of_key.index_select(0, ascending)

    def _make_level(self, depth: int) -> OctreeLevel:
        if self.node_set == "occupied":
            return self.occupied(depth)
        device = self.leaves.keys.device
        if depth <= FULL_DEPTH:
            return OctreeLevel(depth, self.batch_n, torch.arange(self.batch_n * 8**depth, device=device))
        keys = self.occupied(depth - 1).keys[:, None] * 8 + torch.arange(8, device=device)
        return OctreeLevel(depth, self.batch_n, keys.view(-1))


@cache
def _offsets(depth: int, device: torch.device) -> Tensor:
    """int32 ``(27,)``: steps to the neighbours in a padded row-major grid."""
    side = 2**depth + 2
    steps = torch.cartesian_prod(*[torch.arange(-1, 2)] * 3)
    return (steps @ torch.tensor([side * side, side, 1])).int().to(device)
