"""Points to a stored octree."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from torch import Tensor

from tr_grasp.octree.frame import OctreeFrame
from tr_grasp.octree.morton import code_of_cells
from tr_grasp.octree.spec import HALF_DIAGONAL, OctreeSpec

_SHORTEST_NORMAL_SUM = 1e-6


def octree_from_points(
    points: ArrayLike | Tensor, normals: ArrayLike | Tensor, colours: ArrayLike | Tensor | None, spec: OctreeSpec
) -> OctreeFrame:
    """Average the points of each leaf of the cube.

    Points outside the cube and points with a value that is not finite are left out. If more leaves are occupied than
    the frame holds, those with the most points stay; among equals the smaller Morton code does. Zero points give an
    empty frame.

    Args:
        points: ``(n, 3)`` positions, base frame [m].
        normals: ``(n, 3)`` unit normals, base frame.
        colours: ``(n, 3)`` rgb in [0, 1]; not read, and may be ``None``, if the spec stores no colour.
        spec: The cube.

    Raises:
        ValueError: If the arrays do not have shape ``(n, 3)`` with one ``n``, or colours are missing.

    Source: leaf features as in O-CNN (Wang et al. 2017) and drl_grasping 1.1.0.
    """
    columns = _columns({"points": points, "normals": normals} | ({"colours": colours} if spec.colour else {}))
    codes, columns = _inside(columns, spec)
    frame = OctreeFrame.unoccupied(spec)
    if not len(codes):
        return frame
    counts = np.bincount(codes, minlength=8**spec.depth)
    kept = _kept_codes(counts, spec.leaf_capacity)
    frame.codes[: len(kept)] = torch.from_numpy(kept)
    frame.features[: len(kept)] = torch.from_numpy(_leaf_features(codes, columns, counts, kept)).T
    return frame


def _columns(given: dict[str, ArrayLike | Tensor | None]) -> NDArray[np.float64]:
    """``(3 * arrays, n)``: the arrays under each other, one contiguous row for each of their columns."""
    arrays = {
        name: value.detach().cpu().numpy() if isinstance(value, Tensor) else np.asarray(value)
        for name, value in given.items()
    }
    n = len(arrays["points"]) if arrays["points"].ndim else 0
    columns = np.empty((3 * len(arrays), n))
    for start, (name, array) in zip(range(0, len(columns), 3), arrays.items(), strict=True):
        if array.shape != (n, 3):
            raise ValueError(f"{name} must have shape ({n}, 3), one row for each point; got {array.shape}.")
        columns[start : start + 3] = array.T
    return columns


def _inside(columns: NDArray[np.float64], spec: OctreeSpec) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Codes and columns of the finite points in the cube; positions now count from the leaf's centre, in leaf units."""
    places = columns[:3]
    places -= np.array(spec.origin_m)[:, None]
    places *= 1 / spec.leaf_m
    # A NaN position fails both comparisons; the sum of a point's numbers carries a NaN or infinity from anywhere else.
    with np.errstate(invalid="ignore"):
        inside = (places >= 0).all(0) & (places < spec.cells_n).all(0) & np.isfinite(columns.sum(0))
    columns = columns.take(np.flatnonzero(inside), axis=1)
    cells = np.floor(columns[:3])
    columns[:3] -= cells + 0.5
    return code_of_cells(cells, spec.depth), columns


def _kept_codes(counts: NDArray[np.int64], capacity: int) -> NDArray[np.int64]:
    occupied = np.flatnonzero(counts)
    if len(occupied) <= capacity:
        return occupied
    fullest = np.argsort(-counts[occupied], kind="stable")[:capacity]
    return np.sort(occupied[fullest])


def _leaf_features(
    codes: NDArray[np.int64], columns: NDArray[np.float64], counts: NDArray[np.int64], kept: NDArray[np.int64]
) -> NDArray[np.float64]:
    """``(channels, leaves)``: mean normal of length 1, signed distance and mean colour of the kept leaves."""
    leaf_of_code = np.full(len(counts), len(kept))  # leaves that did not fit share one last, ignored place
    leaf_of_code[kept] = np.arange(len(kept))
    leaf = leaf_of_code[codes]
    sums = np.array([np.bincount(leaf, weights=column, minlength=len(kept) + 1)[: len(kept)] for column in columns])

    offsets, normals, colours = sums[:3], sums[3:6], sums[6:]
    lengths = np.sqrt((normals * normals).sum(0))
    for index in np.flatnonzero(lengths < _SHORTEST_NORMAL_SUM):
        normals[:, index], lengths[index] = columns[3:6, np.argmax(leaf == index)], 1.0
    normals /= lengths
    counts = counts[kept]
    distances = (offsets * normals).sum(0) / (counts * HALF_DIAGONAL)
    return np.concatenate([normals, distances[None], colours / counts])
