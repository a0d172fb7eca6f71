"""Reducing runs of consecutive rows, and copying a row to its run: the children of a node, or the nodes of a sample."""

from __future__ import annotations

from typing import Any, NamedTuple

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from tr_grasp.octree.structure import Pool


class Runs(NamedTuple):
    """Rows in runs, one after the other, and every run has an owner."""

    lengths: Tensor
    """int64 ``(m,)``: rows of each run; may be 0."""

    owners: Tensor
    """int ``(n,)``: owner of each row."""

    some_are_empty: bool = True
    """``False`` where it is known that none is, which saves looking."""

    def spread(self, features: Tensor) -> Tensor:
        """``(m, channels)`` of the owners to ``(n, channels)``."""
        return _Spread.apply(features, self.lengths, self.owners)

    def reduce(self, features: Tensor, kind: Pool) -> Tensor:
        """``(n, channels)`` to ``(m, channels)``; an empty run gives 0. Equal maxima share the gradient."""
        if kind == "max":
            reduced = _Largest.apply(features, self.lengths, self.owners)
        else:
            reduced = _reduce(features, "mean", self.lengths)
        return reduced.masked_fill((self.lengths == 0)[:, None], 0) if self.some_are_empty else reduced


class _Spread(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, features: Tensor, lengths: Tensor, owners: Tensor) -> Tensor:
        ctx.save_for_backward(lengths)
        return features.index_select(0, owners)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad: Tensor) -> tuple[Tensor, None, None]:
        # The gradient of index_select would scatter.
        (lengths,) = ctx.saved_tensors
        return _reduce(grad.contiguous(), "sum", lengths), None, None


class _Largest(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, features: Tensor, lengths: Tensor, owners: Tensor) -> Tensor:
        largest = _reduce(features, "max", lengths)
        ctx.save_for_backward(features, largest, lengths, owners)
        return largest

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad: Tensor) -> tuple[Tensor, None, None]:
        # That of segment_reduce divides only positive gradients among equal maxima (torch 2.13), and is slower.
        features, largest, lengths, owners = ctx.saved_tensors
        is_largest = largest.index_select(0, owners).eq_(features)  # ones and zeros of the features' type
        share = grad / _reduce(is_largest, "sum", lengths)
        return is_largest.mul_(share.index_select(0, owners)), None, None


def _reduce(features: Tensor, how: str, lengths: Tensor) -> Tensor:
    return torch.segment_reduce(features, how, lengths=lengths, unsafe=True)
