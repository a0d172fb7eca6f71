"""Patterns that repeat without a seam: square fields of numbers, from which textures are coloured.

Every pattern is a function of its size, of how many cells it has along an edge, and of a generator of random numbers.
Its values lie in [0, 2]: 0, 1 and 2 stand for the three colours of a palette, what is between for mixtures of
neighbours.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Field = NDArray[np.floating]
Pattern = Callable[[int, int, np.random.Generator], Field]


def noise(size_px: int, cells: tuple[int, int], rng: np.random.Generator) -> Field:
    """(size, size) smooth noise in [0, 1] with ``cells`` bumps along rows and columns."""
    grid = rng.random(cells)
    return _stretched(_stretched(grid, size_px).T, size_px).T


def clouds(size_px: int, cells: int, rng: np.random.Generator) -> Field:
    """Noise on noise of half the size and strength, as in clouds or felt."""
    return 2 * _fractal(size_px, max(2, cells // 2), rng)


def checks(size_px: int, cells: int, rng: np.random.Generator) -> Field:
    """A chessboard of an even number of squares, slightly uneven."""
    column, row = _coordinates(size_px, cells - cells % 2)
    return ((np.floor(column) + np.floor(row)) % 2) * 1.6 + 0.25 * noise(size_px, (32, 32), rng)


def stripes(size_px: int, cells: int, rng: np.random.Generator) -> Field:
    """Straight stripes, now and then with a thin line of the third colour beside them."""
    phase = _coordinates(size_px, cells)[0] % 1
    width, line = rng.uniform(0.3, 0.7), rng.uniform(0.05, 0.15)
    return np.where(phase < width, 0.0, np.where(phase < width + line, 2.0, 1.0))


def wood(size_px: int, cells: int, rng: np.random.Generator) -> Field:
    """Boards with year rings that waver along them, and fine pores."""
    boards = 4
    along, across = _coordinates(size_px, 1)
    board = np.floor(across * boards).astype(int)
    waver = noise(size_px, (2 * boards, 3), rng)
    rings = 0.5 + 0.5 * np.sin(2 * np.pi * (cells * across + 2.2 * waver + 0.4 * np.sin(2 * np.pi * along)))
    pores = noise(size_px, (128, 6), rng)
    tone = rng.uniform(0, 0.45, boards)[board]
    gap = (across * boards) % 1 < 0.03
    return np.where(gap, 2.0, 0.2 + 0.75 * rings * pores + tone)


def speckle(size_px: int, cells: int, rng: np.random.Generator) -> Field:
    """Chips of two colours in a third, as in terrazzo."""
    small = noise(size_px, (8 * cells, 8 * cells), rng) > 0.74
    large = noise(size_px, (4 * cells, 4 * cells), rng) > 0.78
    return np.where(large, 2.0, np.where(small, 1.0, 0.25 * noise(size_px, (cells, cells), rng)))


def tiles(size_px: int, cells: int, rng: np.random.Generator) -> Field:
    """Square tiles, each of a tone of its own, with joints of the third colour."""
    column, row = _coordinates(size_px, cells)
    tone = rng.uniform(0, 1, (cells, cells))[row.astype(int), column.astype(int)]
    joint = rng.uniform(0.04, 0.09)
    return np.where((column % 1 < joint) | (row % 1 < joint), 2.0, tone)


def marble(size_px: int, cells: int, rng: np.random.Generator) -> Field:
    """Thin veins through a cloudy stone."""
    column, row = _coordinates(size_px, 1)
    warp = _fractal(size_px, 3, rng)
    vein = np.abs(np.sin(np.pi * (max(2, cells // 2) * (column + row) + 2.5 * warp)))
    return 2 * np.exp(-9 * vein) + 0.5 * _fractal(size_px, 4, rng) * (1 - np.exp(-9 * vein))


def bricks(size_px: int, cells: int, rng: np.random.Generator) -> Field:
    """Bricks, every other row shifted by half a brick, in mortar of the third colour."""
    column, row = _coordinates(size_px, cells)
    row = 2 * row
    course = np.floor(row).astype(int)
    column = (column + 0.5 * (course % 2)) % cells
    tone = rng.uniform(0, 1, (2 * cells, cells))[course, column.astype(int)]
    mortar = rng.uniform(0.05, 0.09)
    return np.where((column % 1 < mortar) | (row % 1 < 2 * mortar), 2.0, tone)


def weave(size_px: int, cells: int, rng: np.random.Generator) -> Field:
    """Bands that pass over and under each other."""
    column, row = _coordinates(size_px, 2 * cells)
    over = (np.floor(column) + np.floor(row)) % 2 == 0
    across = np.where(over, column, row) % 1
    shade = np.sin(np.pi * across)
    return np.where(over, 0.0, 1.0) + np.where(shade < 0.3, 2.0, 0.6 * (1 - shade)).clip(0, 1)


def dots(size_px: int, cells: int, rng: np.random.Generator) -> Field:
    """Round dots in staggered rows."""
    column, row = _coordinates(size_px, cells)
    row = 2 * row
    column = column + 0.5 * (np.floor(row) % 2)
    radius = rng.uniform(0.2, 0.32)
    distance = np.hypot(column % 1 - 0.5, (row % 1 - 0.5) / 2)
    return np.where(distance < 0.75 * radius, 1.0, np.where(distance < radius, 2.0, 0.0))


def _fractal(size_px: int, cells: int, rng: np.random.Generator) -> Field:
    """(size, size) noise of four sizes, spread over [0, 1]."""
    total = np.sum([noise(size_px, (cells * 2**k,) * 2, rng) / 2**k for k in range(4)], axis=0)
    return (total - total.min()) / np.ptp(total)


def _coordinates(size_px: int, cells: int) -> tuple[Field, Field]:
    """(size, size) places of the pixels along rows and along columns, in cells."""
    places = (np.arange(size_px) + 0.5) / size_px * cells
    column, row = np.meshgrid(places, places)
    return column, row


def _stretched(grid: Field, size_px: int) -> Field:
    """(size, columns) rows of a grid (cells, columns), blended smoothly from one to the next and round to the first."""
    places = np.arange(size_px) / size_px * len(grid)
    before = places.astype(int)
    share = places - before
    share = (share * share * (3 - 2 * share))[:, None]
    return grid[before] * (1 - share) + grid[(before + 1) % len(grid)] * share
