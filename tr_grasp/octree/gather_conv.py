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

_CHUNK_ELEMENTS = {"cpu": 1 << 17, "cuda": 1 << 28}
"""Values gathered at once: on a CPU they must stay in the cache, which saves more than half of the time."""


def adjoint_table(table: Tensor, inputs_n: int) -> Tensor:
    """int32 ``(inputs_n, taps)``: the output row that reads an input row with a weight; the number of outputs if none.

    Args:
        table: int32 ``(outputs_n, taps)``: input row read by each output row and weight; ``inputs_n`` if none. No
            input may be read twice with one weight.
        inputs_n: Number of input rows.
    """
    outputs_n, taps = table.shape
    adjoint = torch.full(((inputs_n + 1) * taps,), outputs_n, dtype=torch.int32, device=table.device)
    places = table.long() * taps + torch.arange(taps, device=table.device)
    outputs = torch.arange(outputs_n, dtype=torch.int32, device=table.device)
    adjoint.index_copy_(0, places.view(-1), outputs[:, None].expand(-1, taps).reshape(-1))
    return adjoint.view(-1, taps)[:inputs_n]  # the last row collected what reads nothing


class GatherConv(torch.autograd.Function):
    """``out[i] = sum_k features[table[i, k]] @ weight[k]``, where a row past the end counts as zero.

    Arguments of ``apply``: features ``(n, in)``; weight ``(taps, in, out)``; table int32 ``(m, taps)``; adjoint int32
    ``(n, taps)``, or ``None`` for a table that is its own adjoint under reversal of the weights.
    """

    @staticmethod
    def forward(ctx: Any, features: Tensor, weight: Tensor, table: Tensor, adjoint: Tensor | None) -> Tensor:
        """Gather the rows of each tap side by side and multiply."""
        ctx.save_for_backward(features, weight, table, adjoint)
        kernel = weight.flatten(0, 1)
        out = features.new_empty(len(table), kernel.shape[1])
        for rows, gathered in _gather(features, table):
            torch.mm(gathered, kernel, out=out[rows])
        return out

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad: Tensor) -> tuple[Tensor | None, Tensor | None, None, None]:
        """One gather of the output's gradient serves the gradients of features and weight."""
        features, weight, table, adjoint = ctx.saved_tensors
        needs_features, needs_weight = ctx.needs_input_grad[:2]
        if not needs_features:
            return None, _weight_gradient(features, grad, weight, table) if needs_weight else None, None, None
        flipped = adjoint is None
        taps, _, outputs = weight.shape
        kernel = (weight.flip(0) if flipped else weight).transpose(1, 2).reshape(taps * outputs, -1)
        grad_features = torch.empty_like(features)
        grad_kernel = features.new_zeros(features.shape[1], taps * outputs)
        for rows, gathered in _gather(grad, table if flipped else adjoint):
            torch.mm(gathered, kernel, out=grad_features[rows])
            if needs_weight:
                grad_kernel.addmm_(features[rows].t(), gathered)
        grad_weight = grad_kernel.view(-1, taps, outputs).transpose(0, 1)
        return grad_features, grad_weight.flip(0) if flipped else grad_weight, None, None


def _weight_gradient(features: Tensor, grad: Tensor, weight: Tensor, table: Tensor) -> Tensor:
    """Gradient of the weight alone: the first layer, whose narrow input is cheaper to gather than its output."""
    grad_kernel = torch.zeros_like(weight).flatten(0, 1)
    for rows, gathered in _gather(features, table):
        grad_kernel.addmm_(gathered.t(), grad[rows])
    return grad_kernel.view_as(weight)


def _gather(features: Tensor, table: Tensor) -> Iterator[tuple[slice, Tensor]]:
    """Yield slices of the table's rows with ``(rows, taps * channels)`` of the features that they read."""
    padded = F.pad(features, (0, 0, 0, 1))
    width = table.shape[1] * features.shape[1]
    chunk = max(_CHUNK_ELEMENTS["cpu" if features.device.type == "cpu" else "cuda"] // width, 1)
    for start in range(0, len(table), chunk):
        rows = slice(start, min(start + chunk, len(table)))
        gathered = padded.index_select(0, table[rows].reshape(-1))
        yield rows, gathered.view(-1, width)
