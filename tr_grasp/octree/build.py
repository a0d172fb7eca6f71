"""Points to a stored octree."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from torch import Tensor

from tr_grasp.octree.frame import PADDING, OctreeFrame
from tr_grasp.octree.morton import code_of_cell
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
    arrays = _checked_arrays({"points": points, "normals": normals} | ({"colours": colours} if spec.colour else {}))
    codes, rows = _sorted_rows(arrays, spec)
    if not len(codes):
        return OctreeFrame.empty(spec)
    begins = np.empty(len(codes), bool)
    begins[0] = True
    np.not_equal(codes[1:], codes[:-1], out=begins[1:])
    starts = np.flatnonzero(begins)
    features, counts = _leaf_features(rows, starts)
    kept = _kept(counts, spec.leaf_capacity)

    frame = OctreeFrame.empty(spec)
    n = min(len(starts), spec.leaf_capacity)
    frame.codes[:n] = torch.from_numpy(codes[starts[kept]])
    frame.features[:n] = torch.from_numpy(features[kept])
    return frame


def _checked_arrays(given: dict[str, ArrayLike | Tensor | None]) -> list[NDArray]:
    arrays = [value.detach().cpu().numpy() if isinstance(value, Tensor) else np.asarray(value) for value in given.values()]
    n = len(arrays[0]) if arrays[0].ndim else 0
    for name, array in zip(given, arrays, strict=True):
        if array.shape != (n, 3):
            raise ValueError(f"{name} must have shape ({n}, 3), one row for each point; got {array.shape}.")
    return arrays


def _sorted_rows(arrays: list[NDArray], spec: OctreeSpec) -> tuple[NDArray[np.int16], NDArray[np.float64]]:
    """Codes, ascending, of the usable points, and per point: offset from the leaf's centre in leaf units, normal, colour.

    Points of a leaf keep their order.
    """
    points, *others = arrays
    places = (points - np.array(spec.origin_m)) * (1 / spec.leaf_m)
    # A NaN position fails both comparisons; the sum of a row carries a NaN or infinity from anywhere else.
    x, y, z = ((places >= 0) & (places < spec.cells_n)).T
    with np.errstate(invalid="ignore", over="ignore"):
        finite = np.isfinite(sum(array @ np.ones(3, array.dtype) for array in others))
    usable = np.flatnonzero(x & y & z & finite)

    cells = np.floor(places.take(usable, axis=0))
    codes = code_of_cell(cells, spec.depth)
    order = np.argsort(codes, kind="stable")
    usable = usable[order]
    offsets = places.take(usable, axis=0) - cells.take(order, axis=0) - 0.5
    columns = [offsets, *(array.take(usable, axis=0) for array in others)]
    return codes[order], np.concatenate(columns, axis=1, dtype=np.float64)


def _leaf_features(
    rows: NDArray[np.float64], starts: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """``(leaves, channels)``: mean normal of length 1, signed distance, mean colour; and the points of each leaf."""
    counts = np.append(starts[1:], len(rows)) - starts
    sums = np.add.reduceat(rows, starts, axis=0)
    normals = sums[:, 3:6]
    lengths = np.sqrt(np.einsum("ij,ij->i", normals, normals))
    cancelled = lengths < _SHORTEST_NORMAL_SUM
    if cancelled.any():
        normals[cancelled] = rows[starts[cancelled], 3:6]
        lengths[cancelled] = 1.0
    normals /= lengths[:, None]

    features = np.empty((len(starts), rows.shape[1] - 2))
    features[:, :3] = normals
    features[:, 3] = np.einsum("ij,ij->i", sums[:, :3], normals) / (counts * HALF_DIAGONAL)
    np.divide(sums[:, 6:], counts[:, None], out=features[:, 4:])
    return features, counts


def _kept(counts: NDArray[np.int64], capacity: int) -> slice | NDArray[np.int64]:
    if len(counts) <= capacity:
        return slice(None)
    return np.sort(np.argsort(-counts, kind="stable")[:capacity])
