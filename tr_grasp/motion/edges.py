"""Straight pieces in joint space: their points, their length, whether they are free."""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise

import numpy as np

from tr_grasp.motion.arguments import Array
from tr_grasp.motion.collision import CollisionModel


def steps_between(a: Array, b: Array, resolution_rad: float) -> int:
    """Pieces into which a straight line (dof,) to (dof,) is cut so that no joint moves further than the resolution."""
    return max(1, int(np.ceil(np.abs(b - a).max() / resolution_rad - 1e-9)))


def points_of(path: Array, resolution_rad: float) -> Array:
    """Points (m, dof) along a path (n, dof), its waypoints included, in order."""
    pieces = [
        a + (b - a) * np.linspace(0.0, 1.0, steps_between(a, b, resolution_rad), endpoint=False)[:, None]
        for a, b in pairwise(path)
    ]
    return np.vstack([*pieces, path[-1:]])


def edge_is_free(model: CollisionModel, a: Array, b: Array, resolution_rad: float, time_s: float = 0.0) -> bool:
    """Whether the straight line from ``a`` (taken to be free) to ``b`` is; both (dof,).

    The end and the middle come first, then the middles of the halves: where a line is blocked, that finds out soonest.
    """
    order = _bisection(steps_between(a, b, resolution_rad))
    return model.all_free(a + (b - a) * order[:, None], time_s)


def path_is_free(model: CollisionModel, path: Array, resolution_rad: float, time_s: float = 0.0) -> bool:
    """Whether all of a path (n, dof) is."""
    return model.all_free(points_of(path, resolution_rad), time_s)


def path_length(path: Array) -> float:
    """Sum of the pieces' Euclidean lengths [rad]."""
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


@lru_cache(maxsize=512)
def _bisection(n: int) -> Array:
    """The numbers 1/n, 2/n, …, 1 so that every prefix is spread out; the end comes first."""
    bits = max(1, (n - 1).bit_length())
    codes = [int(format(i, f"0{bits}b")[::-1], 2) for i in range(n)]
    order = sorted(range(n), key=codes.__getitem__)
    return (n - np.array(order)) / n
