"""Reducing runs of consecutive rows, and copying a row to its run: the children of a node, or the nodes of a sample."""

from __future__ import annotations

from typing import Any, NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor
from torch.autograd.function import once_differentiable

from tr_grasp.octree.structure import Pool

_FOLDS = {"max": torch.maximum, "sum": torch.add}


class Turns(NamedTuple):
    """Short runs taken in turns: the first row of each, then the second of those that have one, and so on.

    The longest runs stand first, so that each turn meets the foremost ones. On a CPU this takes half the time of
    ``segment_reduce``, which goes through the values one by one.
    """

    rows: tuple[Tensor, ...]
    """int64: the rows of each turn."""

    places: Tensor
    """int64 ``(m,)``: where each run stands."""

    @classmethod
    def of(cls, lengths: Tensor) -> Turns:
        """The turns of runs of these lengths, one after the other."""
        order = lengths.argsort(descending=True, stable=True)
        first = (lengths.cumsum(0) - lengths).index_select(0, order)
        longer_n = lengths.bincount().flip(0).cumsum(0).flip(0).tolist()[1:]  # runs of at least 1, 2, … rows
        places = torch.empty_like(order).index_copy_(0, order, torch.arange(len(order), device=order.device))
        return cls(tuple(first[:n] + turn for turn, n in enumerate(longer_n)), places)

    def reduce(self, features: Tensor, how: str) -> Tensor:
        """``(n, channels)`` to ``(m, channels)``; an empty run gives 0."""
        folded = features.index_select(0, self.rows[0]) if self.rows else features[:0]
        for rows in self.rows[1:]:
            met = folded[: len(rows)]
            _FOLDS[how](met, features.index_select(0, rows), out=met)
        if len(folded) < len(self.places):
            folded = F.pad(folded, (0, 0, 0, len(self.places) - len(folded)))
        return folded.index_select(0, self.places)


class Runs(NamedTuple):
    """Rows in runs, one after the other, and every run has an owner."""

    lengths: Tensor
    """int64 ``(m,)``: rows of each run; may be 0."""

    owners: Tensor
    """int ``(n,)``: owner of each row."""

    some_are_empty: bool = True
    """``False`` where it is known that none is, which saves looking."""

    turns: Turns | None = None
    """Where the runs are short and their number need not be waited for."""

    def spread(self, features: Tensor) -> Tensor:
        """``(m, channels)`` of the owners to ``(n, channels)``."""
        return _Spread.apply(features, self)

    def reduce(self, features: Tensor, kind: Pool) -> Tensor:
        """``(n, channels)`` to ``(m, channels)``; an empty run gives 0. Equal maxima share the gradient."""
        if kind == "max":
            reduced = _Largest.apply(features, self)
        else:
            reduced = torch.segment_reduce(features, "mean", lengths=self.lengths, unsafe=True)
        return reduced.masked_fill((self.lengths == 0)[:, None], 0) if self.some_are_empty else reduced

    def fold(self, features: Tensor, how: str) -> Tensor:
        """``max`` or ``sum`` over each run, without gradient; what an empty one gives is left open."""
        if self.turns is not None:
            return self.turns.reduce(features, how)
        return torch.segment_reduce(features, how, lengths=self.lengths, unsafe=True)


class _Spread(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, features: Tensor, runs: Runs) -> Tensor:
        ctx.runs = runs
        return features.index_select(0, runs.owners)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad: Tensor) -> tuple[Tensor, None]:
        # The gradient of index_select would scatter.
        return ctx.runs.fold(grad.contiguous(), "sum"), None


class _Largest(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, features: Tensor, runs: Runs) -> Tensor:
        largest = runs.fold(features, "max")
        ctx.save_for_backward(features, largest)
        ctx.runs = runs
        return largest

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad: Tensor) -> tuple[Tensor, None]:
        # That of segment_reduce divides only positive gradients among equal maxima (torch 2.13), and is slower.
        features, largest = ctx.saved_tensors
        runs = ctx.runs
        is_largest = largest.index_select(0, runs.owners).eq_(features)  # ones and zeros of the features' type
        share = grad / runs.fold(is_largest, "sum")
        return is_largest.mul_(share.index_select(0, runs.owners)), None
