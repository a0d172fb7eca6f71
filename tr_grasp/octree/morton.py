"""Morton codes: one integer for an octant, whose parent is ``code >> 3``.

The code interleaves the bits of the cell coordinates; in each group of three bits x is the most significant,
then y, then z. So ``code & 7`` is ``4 * (x & 1) + 2 * (y & 1) + (z & 1)``, and codes of the eight children of an
octant are consecutive.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor


def encode_cells(cells: NDArray[np.integer], depth: int) -> NDArray[np.int64]:
    """Morton codes of cell coordinates ``(*batch, 3)`` in ``[0, 2**depth)``."""
    codes = np.zeros(cells.shape[:-1], np.int64)
    for bit in range(depth):
        octant = (cells >> bit & 1) @ np.array([4, 2, 1])
        codes |= octant.astype(np.int64) << 3 * bit
    return codes


def code_of_cells(cells: NDArray[np.float64], depth: int) -> NDArray[np.int64]:
    """Morton codes ``(n,)`` of cells ``(3, n)``, whole numbers stored as floats; by a table."""
    side = 2.0**depth
    return _code_table(depth).take((np.array([side * side, side, 1.0]) @ cells).astype(np.intp))


@cache
def _code_table(depth: int) -> NDArray[np.int64]:
    """Code of every cell in row-major order."""
    cells = np.stack(np.meshgrid(*[np.arange(2**depth)] * 3, indexing="ij"), axis=-1)
    return encode_cells(cells.reshape(-1, 3), depth)


@cache
def _cell_table(depth: int) -> NDArray[np.int64]:
    """Cell of every code."""
    return np.stack(np.unravel_index(_code_table(depth).argsort(), [2**depth] * 3), axis=-1)


@cache
def _raster_table(depth: int, pad: int) -> NDArray[np.int64]:
    """Index of every code in a padded row-major grid."""
    side = 2**depth + 2 * pad
    return (_cell_table(depth) + pad) @ np.array([side * side, side, 1])


def cell_table(depth: int, device: torch.device) -> Tensor:
    """Table ``(8**depth, 3)`` int64: cell coordinates of every Morton code."""
    return _on_device(_cell_table, (depth,), device)


def raster_order(depth: int, device: torch.device) -> Tensor:
    """Table ``(8**depth,)`` int64: the code of every cell in row-major order."""
    return _on_device(_code_table, (depth,), device)


def raster_table(depth: int, pad: int, device: torch.device) -> Tensor:
    """Table ``(8**depth,)`` int64: row-major index of every code in a grid padded by ``pad`` cells on each side."""
    return _on_device(_raster_table, (depth, pad), device)


def _on_device(make: Callable[..., NDArray[np.int64]], sizes: tuple[int, ...], device: torch.device) -> Tensor:
    # What is made while a graph is traced has no values, and must not be kept for those who run it.
    keep = _make_on_device.__wrapped__ if torch.compiler.is_compiling() else _make_on_device
    return keep(make, sizes, device)


@cache
def _make_on_device(make: Callable[..., NDArray[np.int64]], sizes: tuple[int, ...], device: torch.device) -> Tensor:
    return torch.from_numpy(make(*sizes)).to(device)
