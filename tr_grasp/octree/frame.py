"""One octree as it is stored: a padded list of its non-empty leaves."""

from __future__ import annotations

import torch
from tensordict import TensorClass
from torch import Tensor

from tr_grasp.octree.spec import OctreeSpec

PADDING = -1
"""Morton code of a slot that holds no leaf."""


class OctreeFrame(TensorClass["nocast"]):
    """Non-empty leaves of an octree, or of a batch of them.

    A frame takes 8 KiB at 512 leaves. Everything else about the octree (parents, children, neighbours) follows from
    the codes and is rebuilt where it is needed, see ``Octree``. A frame without a leaf is legal: it is what a camera
    reports that sees nothing inside the cube.
    """

    codes: Tensor
    """int16 (int32 at depth 6) ``(*batch, leaf_capacity)``: Morton codes, ascending when built from points; -1 is
    padding."""

    features: Tensor
    """float16 ``(*batch, leaf_capacity, channels)``: mean normal (unit, base frame), signed distance of the mean
    point from the leaf's centre along it, in [-1, 1] (1 is half a leaf diagonal), mean rgb in [0, 1]; 0 in padding."""

    @classmethod
    def unoccupied(cls, spec: OctreeSpec, batch_size: tuple[int, ...] = ()) -> OctreeFrame:
        """Frames without a single leaf."""
        shape = (*batch_size, spec.leaf_capacity)
        return cls(
            codes=torch.full(shape, PADDING, dtype=spec.code_dtype),
            features=torch.zeros(*shape, spec.channels, dtype=torch.float16),
            batch_size=list(batch_size),
        )

    @property
    def leaves_n(self) -> Tensor:
        """int64 ``(*batch,)``: number of leaves."""
        return (self.codes != PADDING).sum(-1)
