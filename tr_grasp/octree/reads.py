"""Tables of which input rows each output row reads with each weight, the rows sorted into parts that need few weights.

Where a table holds the number of inputs, nothing is read.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

KERNEL_SIDE = 3


class Part(NamedTuple):
    """Consecutive rows that read nothing but with consecutive weights."""

    first_row: int
    first_tap: int

    table: Tensor
    """int32 ``(rows, taps)``."""


class Reads(NamedTuple):
    """A table in parts."""

    parts: tuple[Part, ...]

    rows_n: int

    order: Tensor | None = None
    """int64 ``(rows_n,)``: the output row that stands at each place of the parts; ``None`` if they are in order."""

    places: Tensor | None = None
    """int64 ``(rows_n,)``: the inverse."""

    def in_order(self, rows: Tensor) -> Tensor:
        """``(rows_n, channels)`` in the order of the parts, as outputs are ordered."""
        return rows if self.places is None else rows.index_select(0, self.places)

    def in_parts(self, rows: Tensor) -> Tensor:
        """``(rows_n, channels)`` as outputs are ordered, in the order of the parts."""
        return rows if self.order is None else rows.index_select(0, self.order)


def in_one_part(table: Tensor) -> Reads:
    """int32 ``(m, taps)`` as one part."""
    return Reads((Part(0, 0, table),), len(table))


def by_layers(table: Tensor, inputs_n: int) -> Reads:
    """int32 ``(m, 27)`` in parts by the layers of the kernel that a row needs: its own, and those before and after.

    A node of a surface mostly has an empty layer on one side, or on both. Leaving these out leaves out zeros alone.

    Args:
        table: The offsets in an order whose slowest axis is that of the layers; the middle tap is always read.
        inputs_n: What stands for nothing.
    """
    layer = table.shape[1] // KERNEL_SIDE
    needed = table.view(-1, KERNEL_SIDE, layer).amin(2) < inputs_n
    kinds = needed[:, 0].int() + 2 * needed[:, 2].int()
    parts, orders, first_row = [], [], 0
    for kind in range(4):
        rows = (kinds == kind).nonzero().view(-1)
        taps = slice(0 if kind & 1 else layer, (3 if kind & 2 else 2) * layer)
        if len(rows):
            parts.append(Part(first_row, taps.start, table.index_select(0, rows)[:, taps].contiguous()))
        orders.append(rows)
        first_row += len(rows)
    order = torch.cat(orders)
    places = torch.empty_like(order).index_copy_(0, order, torch.arange(len(order), device=order.device))
    return Reads(tuple(parts), len(table), order, places)


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
