"""Shorter paths by straight lines between points of them."""

from __future__ import annotations

import numpy as np

from tr_grasp.motion.arguments import Array
from tr_grasp.motion.collision import CollisionModel
from tr_grasp.motion.edges import edge_is_free


def shortcut(
    model: CollisionModel,
    path: Array,
    attempts_n: int,
    resolution_rad: float,
    rng: np.random.Generator,
    time_s: float = 0.0,
) -> Array:
    """A path (m, dof) with the ends of a path (n, dof), never longer; free at this resolution if that one is.

    First every waypoint sees as far along the path as it can, then random points in the middle of pieces are joined.

    Source: Geraerts & Overmars 2007, Creating high-quality paths for motion planning.
    """
    path = _skip_waypoints(model, path, resolution_rad, time_s)
    for _ in range(attempts_n):
        if len(path) < 3:
            break
        s = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1)))
        first, last = np.sort(rng.uniform(0.0, s[-1], 2))
        i, j = np.searchsorted(s, [first, last], side="right") - 1
        if i == j:
            continue
        a, b = _at(path, s, i, first), _at(path, s, j, last)
        # The halves of cut pieces are checked at other points than the pieces were, and must pass as well.
        edges = ((a, b), (path[i], a), (b, path[j + 1]))
        if all(edge_is_free(model, start, end, resolution_rad, time_s) for start, end in edges):
            path = np.vstack([path[: i + 1], a, b, path[j + 1 :]])
    return path


def _skip_waypoints(model: CollisionModel, path: Array, resolution_rad: float, time_s: float) -> Array:
    kept, i = [path[0]], 0
    while i < len(path) - 1:
        # Halving instead of trying every waypoint: a few checks, and what it misses the random attempts find.
        j = len(path) - 1
        while j > i + 1 and not edge_is_free(model, path[i], path[j], resolution_rad, time_s):
            j = (i + j) // 2
        kept.append(path[j])
        i = j
    return np.array(kept)


def _at(path: Array, s: Array, i: int, position: float) -> Array:
    share = (position - s[i]) / max(s[i + 1] - s[i], 1e-12)
    return path[i] + (path[i + 1] - path[i]) * share
