"""A batch of frames merged into one octree.

Nodes of all samples share one list per depth, ordered by key = ``code + 8**depth * sample``, and features have one row
for each. ``Octree`` is what networks see; how rows are stored and what the operators do with them is the backend's
matter, see ``tr_grasp.octree.sparse`` and ``tr_grasp.octree.dense``.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Literal

import torch
from torch import Tensor

from tr_grasp.errors import ConfigError, unknown_name
from tr_grasp.octree.frame import OctreeFrame
from tr_grasp.octree.morton import cell_table, raster_table
from tr_grasp.octree.spec import HALF_DIAGONAL

NodeSet = Literal["occupied", "siblings"]
NODE_SETS = ("occupied", "siblings")

Backend = Literal["sparse", "dense"]
BACKENDS = ("sparse", "dense")

Pool = Literal["max", "average"]

FULL_DEPTH = 2
"""Depth down to which the node set ``siblings`` holds every octant, as in O-CNN."""


@dataclass(frozen=True, eq=False)
class OctreeLevel(ABC):
    """The rows of one depth, in ascending order of their keys."""

    depth: int
    batch_n: int
    keys: Tensor
    """int64 ``(n,)``: ``code + 8**depth * sample``."""

    @property
    def nodes_n(self) -> int:
        """Number of rows, all samples together."""
        return self.keys.shape[0]

    @property
    def octants_n(self) -> int:
        """Octants of one sample at this depth, present or not."""
        return 8**self.depth

    @cached_property
    def samples(self) -> Tensor:
        """int64 ``(n,)``: the sample that a row belongs to."""
        return self.keys >> 3 * self.depth

    @cached_property
    def codes(self) -> Tensor:
        """int64 ``(n,)``: Morton codes."""
        return self.keys & (self.octants_n - 1)

    @cached_property
    def cells(self) -> Tensor:
        """int64 ``(n, 3)``: x, y, z of each row, in cells of this depth."""
        return cell_table(self.depth, self.keys.device).index_select(0, self.codes)

    @cached_property
    def raster(self) -> Tensor:
        """int64 ``(n,)``: index of each row in a row-major ``(batch, x, y, z)`` grid."""
        in_sample = raster_table(self.depth, 0, self.keys.device).index_select(0, self.codes)
        return in_sample + self.samples * self.octants_n

    @abstractmethod
    def pad(self, features: Tensor) -> Tensor:
        """``(n, channels)`` as ``(batch, most rows of a sample, channels)``, zero where there is no node."""

    @abstractmethod
    def pool(self, features: Tensor, kind: Pool = "max") -> Tensor:
        """``(n, channels)`` to ``(batch, channels)`` over the nodes of each sample; 0 for a sample without any."""


class Octree(ABC):
    """Octrees of a batch of frames, merged.

    Like ``pathlib.Path`` it is made as a subclass, here that of the backend. Both give the same numbers to rounding,
    forwards and backwards, at every node; what is written for one runs on the other.

    Args:
        frames: Batch size ``(B,)``, or anything with their ``codes`` and ``features``; codes in any order, none twice
            in a sample, padding anywhere.
        depth: Depth of the frames' leaves.
        node_set: ``occupied``: nodes are the octants that hold a leaf. ``siblings``: all eight children of every
            octant that holds a leaf, and every octant down to depth 2 (O-CNN).
        backend: ``sparse``: a row for each node; fast, for training and for acting. ``dense``: a row for each octant,
            node or not; shapes depend on nothing but the batch, so it can be exported.

    Raises:
        ConfigError: If ``node_set`` or ``backend`` does not exist.
        ValueError: If the frames have more than one batch dimension, tensors that do not belong together, codes that
            are no integers, or a code past the depth (looked for on the CPU only: elsewhere it would wait).
    """

    backend: ClassVar[Backend] = "sparse"
    _classes: ClassVar[dict[str, type[Octree]]] = {}

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        Octree._classes[cls.backend] = cls

    def __new__(
        cls, frames: OctreeFrame, depth: int, node_set: NodeSet = "occupied", backend: Backend | None = None
    ) -> Octree:
        """An object of the backend's class."""
        if backend is not None and backend not in BACKENDS:
            raise ConfigError(unknown_name("backend", backend, BACKENDS))
        made = cls if cls is not Octree else cls._classes[backend or "sparse"]
        return object.__new__(made)

    def __init__(
        self, frames: OctreeFrame, depth: int, node_set: NodeSet = "occupied", backend: Backend | None = None
    ) -> None:
        if node_set not in NODE_SETS:
            raise ConfigError(unknown_name("node set", node_set, NODE_SETS))
        _check(frames.codes, frames.features, depth)
        self.depth = depth
        self.node_set = node_set
        self.batch_n = frames.codes.shape[0]
        self._load(frames.codes, frames.features)

    @abstractmethod
    def _load(self, codes: Tensor, features: Tensor) -> None:
        """Take over codes ``(B, capacity)`` and features ``(B, capacity, channels)``."""

    @property
    @abstractmethod
    def leaves(self) -> OctreeLevel:
        """The rows of the leaves, whatever the node set."""

    @abstractmethod
    def level(self, depth: int) -> OctreeLevel:
        """The rows of this depth.

        Raises:
            ValueError: If the octree has no such depth.
        """

    @abstractmethod
    def occupied(self, depth: int) -> OctreeLevel:
        """Octants of this depth that hold a leaf, whatever the node set."""

    @abstractmethod
    def leaf_features(self, dtype: torch.dtype = torch.float32) -> Tensor:
        """``(leaves, channels)``: stored features of the rows of ``leaves``."""

    @abstractmethod
    def node_features(self, dtype: torch.dtype = torch.float32) -> Tensor:
        """``(n, channels)``: stored features of the finest nodes, zero in empty siblings."""

    @abstractmethod
    def parents(self, depth: int) -> Tensor:
        """Row of each node's parent among the rows of ``depth - 1``, int ``(n,)``."""

    @abstractmethod
    def children_n(self, depth: int) -> Tensor:
        """int64 ``(n,)``: how many children of each node are nodes."""

    @abstractmethod
    def conv(self, features: Tensor, weight: Tensor, depth: int, stride: int) -> Tensor:
        """``octree_conv``."""

    @abstractmethod
    def deconv(self, features: Tensor, weight: Tensor, depth: int) -> Tensor:
        """``octree_deconv``."""

    @abstractmethod
    def pool(self, features: Tensor, depth: int, kind: Pool) -> Tensor:
        """``octree_pool``."""

    @abstractmethod
    def upsample(self, features: Tensor, depth: int) -> Tensor:
        """``octree_upsample``."""

    @abstractmethod
    def to_voxels(self, features: Tensor, depth: int) -> Tensor:
        """``octree_to_voxels``."""

    @abstractmethod
    def join_children(self, features: Tensor, depth: int) -> Tensor:
        """``octree_join_children``."""

    def _check_depth(self, depth: int) -> None:
        if not 0 <= depth <= self.depth:
            raise ValueError(f"depth must be 0..{self.depth} in an octree of depth {self.depth}, got {depth}.")

    def leaf_points(self) -> Tensor:
        """float32 ``(leaves, 3)``: mean point of each leaf as far as it is known, in units of the cube.

        The cube's centre is the origin and half its edge is 1. The point is put at the stored distance from the
        cell's centre along the mean normal, which is exact for a plane.
        """
        features = self.leaf_features()
        leaf = 2 / 2**self.depth
        centres = (self.leaves.cells + 0.5) * leaf - 1
        return centres + features[:, :3] * features[:, 3:4] * (leaf * HALF_DIAGONAL)


def _check(codes: Tensor, features: Tensor, depth: int) -> None:
    if codes.ndim != 2:
        raise ValueError(f"frames must have batch size (B,), got codes of shape {tuple(codes.shape)}.")
    if features.ndim != 3 or features.shape[:2] != codes.shape:
        shapes = f"codes {tuple(codes.shape)} and features {tuple(features.shape)}"
        raise ValueError(f"features must have the codes' shape and channels behind it, got {shapes}.")
    if codes.is_floating_point() or codes.is_complex() or codes.dtype == torch.bool:
        raise ValueError(f"codes must be integers, got {codes.dtype}.")
    if codes.device != features.device:
        raise ValueError(f"codes and features must be on one device, got {codes.device} and {features.device}.")
    if codes.device.type != "cpu" or torch.compiler.is_compiling() or not codes.numel():
        return
    largest = int(codes.max())
    if largest >= 8**depth:
        raise ValueError(f"codes must be less than 8**{depth}, but frames hold {largest}: are they of another depth?")
