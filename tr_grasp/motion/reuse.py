"""A plan for a goal that has moved, made from the plan for where it was."""

from __future__ import annotations

import numpy as np

from tr_grasp.motion.arguments import Array
from tr_grasp.motion.collision import CollisionModel
from tr_grasp.motion.edges import edge_is_free, path_is_free


def rest_of(path: Array, q: Array) -> Array:
    """A path (n, dof) cut at the point that is nearest to the joints now (dof,), which become its start."""
    a, way = path[:-1], np.diff(path, axis=0)
    share = np.clip(((q - a) * way).sum(1) / np.maximum((way**2).sum(1), 1e-12), 0.0, 1.0)
    nearest = int(np.argmin(np.linalg.norm(a + share[:, None] * way - q, axis=1)))
    return np.vstack([q, path[nearest + 1 :]])


def bend_to(
    model: CollisionModel, rest: Array, goal: Array, resolution_rad: float, time_s: float = 0.0
) -> Array | None:
    """The path with as much of its beginning kept as possible and one straight line to the new goal, or nothing.

    The straight line from the start comes first: near the goal it is what is left anyway.
    """
    if edge_is_free(model, rest[0], goal, resolution_rad, time_s):
        return np.stack([rest[0], goal])
    kept = free_beginning(model, rest[:-1], resolution_rad, time_s)
    for k in range(len(kept), 1, -1):
        if edge_is_free(model, kept[k - 1], goal, resolution_rad, time_s):
            return np.vstack([kept[:k], goal])
    return None


def free_beginning(model: CollisionModel, path: Array, resolution_rad: float, time_s: float = 0.0) -> Array:
    """The waypoints (k, dof), k ≥ 1, up to the first blocked piece."""
    if len(path) < 2 or path_is_free(model, path, resolution_rad, time_s):
        return path
    k = 1
    while k < len(path) and edge_is_free(model, path[k - 1], path[k], resolution_rad, time_s):
        k += 1
    return path[:k]
