"""Sparse convolution as gather and matrix product, forwards and backwards; nothing is ever scattered.

A table says which input row each output row reads with each weight. Its adjoint says, for each input row and weight,
which output row reads it, and there is at most one; so the gradient of the features is a gather too. For a stride of 1
the table is its own adjoint with the weights in reverse order: j is neighbour k of i if i is neighbour 26 - k of j.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import torch
import torch.nn.functional as F
from torch import Tensor
from torch.autograd.function import once_differentiable

from tr_grasp.octree.products import add_product, product
from tr_grasp.octree.reads import Reads

_CHUNK_ELEMENTS = {"cpu": 1 << 19, "cuda": 1 << 28}
"""Values gathered at once: on a CPU they must stay in the cache, which saves more than half of the time."""


class GatherConv(torch.autograd.Function):
    """``out[i] = sum_k features[table[i, k]] @ weight[k]``, where a row past the end counts as zero.

    Arguments of ``apply``: features ``(n, in)``; weight ``(taps, in, out)``; the table, of ``m`` rows; its adjoint, of
    ``n`` rows, or ``None`` for a table that is its own adjoint under reversal of the weights.
    """

    @staticmethod
    def forward(ctx: Any, features: Tensor, weight: Tensor, reads: Reads, adjoint: Reads | None) -> Tensor:
        """Gather the rows of each tap side by side and multiply."""
        ctx.save_for_backward(features, weight)
        ctx.tables = reads, adjoint
        kernel = weight.flatten(0, 1)
        out = features.new_empty(reads.rows_n, kernel.shape[1])
        for rows, columns, gathered in _gather(features, reads):
            product(gathered, kernel[columns], out=out[rows])
        return reads.in_order(out)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad: Tensor) -> tuple[Tensor | None, Tensor | None, None, None]:
        """One gather of the output's gradient serves the gradients of features and weight."""
        features, weight = ctx.saved_tensors
        reads, adjoint = ctx.tables
        needs_features, needs_weight = ctx.needs_input_grad[:2]
        if not needs_features:
            return None, _weight_gradient(features, grad, weight, reads) if needs_weight else None, None, None
        flipped = adjoint is None
        back = reads if flipped else adjoint
        taps, _, outputs = weight.shape
        kernel = (weight.flip(0) if flipped else weight).transpose(1, 2).reshape(taps * outputs, -1)
        grad_features = torch.empty_like(features)
        grad_kernel = torch.zeros(features.shape[1], taps * outputs, device=features.device, dtype=_sum_type(features))
        features = back.in_parts(features)
        for rows, columns, gathered in _gather(grad, back):
            product(gathered, kernel[columns], out=grad_features[rows])
            if needs_weight:
                add_product(grad_kernel[:, columns], features[rows].t(), gathered)
        grad_weight = grad_kernel.to(weight.dtype).view(-1, taps, outputs).transpose(0, 1)
        return back.in_order(grad_features), grad_weight.flip(0) if flipped else grad_weight, None, None


def _weight_gradient(features: Tensor, grad: Tensor, weight: Tensor, reads: Reads) -> Tensor:
    """Gradient of the weight alone: the first layer, whose narrow input is cheaper to gather than its output."""
    grad_kernel = torch.zeros_like(weight, dtype=_sum_type(weight)).flatten(0, 1)
    grad = reads.in_parts(grad)
    for rows, columns, gathered in _gather(features, reads):
        add_product(grad_kernel[columns], gathered.t(), grad[rows])
    return grad_kernel.view_as(weight).to(weight.dtype)


def _gather(features: Tensor, reads: Reads) -> Iterator[tuple[slice, slice, Tensor]]:
    """Yield slices of the table's rows and of ``taps * channels``, and the features that they read.

    Every chunk lies in the same memory, so what is yielded holds until the next one is asked for.
    """
    padded = F.pad(features, (0, 0, 0, 1))
    channels = features.shape[1]
    elements = _CHUNK_ELEMENTS["cpu" if features.device.type == "cpu" else "cuda"]
    parts = [part for part in reads.parts if len(part.table)]
    splits = [part.table.split(max(elements // (part.table.shape[1] * channels), 1)) for part in parts]
    memory = features.new_empty(max((tables[0].numel() for tables in splits), default=0) * channels)
    for part, tables in zip(parts, splits, strict=True):
        row, taps = part.first_row, part.table.shape[1]
        columns = slice(part.first_tap * channels, (part.first_tap + taps) * channels)
        for table in tables:
            gathered = memory[: table.numel() * channels].view(-1, channels)
            torch.index_select(padded, 0, table.reshape(-1), out=gathered)
            yield slice(row, row + len(table)), columns, gathered.view(-1, taps * channels)
            row += len(table)


def _sum_type(values: Tensor) -> torch.dtype:
    """Sums over many chunks need more digits than half precision has."""
    return torch.float32 if values.dtype in (torch.bfloat16, torch.float16) else values.dtype
