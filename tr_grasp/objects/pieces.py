"""Which convex parts hang together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.optimize import nnls

Points = NDArray[np.floating]

SUM_WEIGHT = 1e3
"""How much more it counts that weights sum to one than that points meet, in units of the hulls' size."""


def pieces_of(parts: Sequence[trimesh.Trimesh], gap_m: float) -> list[list[int]]:
    """Indices of the parts of every piece; parts no farther apart than ``gap_m`` belong to one piece."""
    corners = [np.asarray(part.vertices) for part in parts]
    pieces: list[list[int]] = []
    for index in range(len(parts)):
        near = [piece for piece in pieces if any(_are_near(corners[index], corners[i], gap_m) for i in piece)]
        pieces = [piece for piece in pieces if piece not in near]
        pieces.append([index, *(i for piece in near for i in piece)])
    return [sorted(piece) for piece in pieces]


def hull_distance(first: Points, second: Points) -> float:
    """Least distance between the convex hulls of two sets of points ``(n, 3)`` and ``(m, 3)``, 0 where they meet.

    The nearest points are weighted means of the corners: a least-squares problem with weights that are not negative.
    """
    both = np.concatenate([first, second])
    size = float(np.linalg.norm(np.ptp(both, axis=0)))
    a, b = ((points - both.mean(axis=0)) / size for points in (first, second))
    sums = SUM_WEIGHT * np.repeat(np.eye(2), [len(a), len(b)], axis=1)
    rows = np.concatenate([np.concatenate([a, -b]).T, sums])
    weights, _ = nnls(rows, np.array([0, 0, 0, SUM_WEIGHT, SUM_WEIGHT]))
    of_a, of_b = weights[: len(a)], weights[len(a) :]
    return size * float(np.linalg.norm(of_a @ a / of_a.sum() - of_b @ b / of_b.sum()))


def _are_near(first: Points, second: Points, gap_m: float) -> bool:
    # Bounding boxes tell most pairs apart at once.
    apart = np.maximum(first.min(axis=0) - second.max(axis=0), second.min(axis=0) - first.max(axis=0))
    return bool((apart <= gap_m).all()) and hull_distance(first, second) <= gap_m
