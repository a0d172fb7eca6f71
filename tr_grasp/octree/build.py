"""Points to a stored octree."""

from __future__ import annotations

import warnings
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from tensordict import TensorDict
from torch import Tensor

from tr_grasp.octree.frame import PADDING, OctreeFrame
from tr_grasp.octree.morton import code_of_cells
from tr_grasp.octree.spec import HALF_DIAGONAL, OctreeSpec

_SHORTEST_NORMAL_SUM = 1e-6

Columns = NDArray[np.floating]
"""``(columns, n)``: one number of each point, or leaf, in a row."""

Rows = NDArray[np.float32]
"""``(n, 3)``: a vector of each point."""

_NUMPY_TYPES = {torch.int16: np.int16, torch.int32: np.int32}


class LeafOverflowWarning(UserWarning):
    """More leaves are occupied than a frame holds."""


class OctreeBuild(NamedTuple):
    """A frame and what did not enter it."""

    frame: OctreeFrame

    ignored_points_n: int
    """Points outside the cube, or with a value that is not finite."""

    dropped_leaves_n: int
    """Leaves with the fewest points, for which the frame had no slot."""


def octree_from_points(
    points: ArrayLike | Tensor, normals: ArrayLike | Tensor, colours: ArrayLike | Tensor | None, spec: OctreeSpec
) -> OctreeFrame:
    """Average the points of each leaf of the cube.

    Points outside the cube and points with a value that is not finite are left out. If more leaves are occupied than
    the frame holds, those with the most points stay; among equals the smaller Morton code does. Zero points give an
    empty frame. Where normals cancel out, the leaf takes that of its first point; otherwise the order of the points
    does not matter.

    Args:
        points: ``(n, 3)`` positions, base frame [m].
        normals: ``(n, 3)`` unit normals, base frame.
        colours: ``(n, 3)`` rgb in [0, 1]; not read, and may be ``None``, if the spec stores no colour.
        spec: The cube.

    Raises:
        ValueError: If the arrays do not have shape ``(n, 3)`` with one ``n``, hold no real numbers, or colours are
            missing.

    Warns:
        LeafOverflowWarning: If leaves were left out; ``count_octree_from_points`` says how many.

    Source: leaf features as in O-CNN (Wang et al. 2017) and drl_grasping 1.1.0.
    """
    built = count_octree_from_points(points, normals, colours, spec)
    if built.dropped_leaves_n:
        # The text is always the same, so that Python shows it once and not for each of a million frames.
        warnings.warn(
            f"More leaves are occupied than leaf_capacity={spec.leaf_capacity}; those with the most points stay. "
            "Raise leaf_capacity or lower depth.",
            LeafOverflowWarning,
            stacklevel=2,
        )
    return built.frame


def count_octree_from_points(
    points: ArrayLike | Tensor, normals: ArrayLike | Tensor, colours: ArrayLike | Tensor | None, spec: OctreeSpec
) -> OctreeBuild:
    """``octree_from_points`` that counts what it leaves out instead of warning of it."""
    position_array = _as_numpy("points", points)
    points_n = len(position_array) if position_array.ndim else 0
    given = {"points": position_array, "normals": _as_numpy("normals", normals)}
    if spec.colour:
        given["colours"] = _as_numpy("colours", colours)
    for name, array in given.items():
        if array.shape != (points_n, 3):
            raise ValueError(f"{name} must have shape ({points_n}, 3), one row for each point; got {array.shape}.")
    values = [np.asarray(array, np.float32) for name, array in given.items() if name != "points"]
    places = position_array.T.astype(np.float64, order="C")
    places -= np.array(spec.origin_m)[:, None]
    places *= 1 / spec.leaf_m
    places, values = _inside(places, values, spec)
    cells = np.floor(places)
    places -= cells
    places -= 0.5  # positions now count from the leaf's centre, in leaf units
    kept, leaf, dropped_n = _occupied(code_of_cells(cells, spec.depth), spec)
    frame = _frame(kept, _leaf_features(leaf, len(kept), places, values), spec)
    return OctreeBuild(frame, points_n - len(leaf), dropped_n)


def _as_numpy(name: str, value: ArrayLike | Tensor | None) -> NDArray[Any]:
    if isinstance(value, Tensor):
        value = value.detach().cpu()
        value = (value.float() if value.dtype == torch.bfloat16 else value).numpy()  # numpy has no bfloat16
    array = np.asarray(value)
    if array.dtype.kind not in "fiu":
        raise ValueError(f"{name} must hold real numbers, got {'None' if value is None else array.dtype}.")
    return array


def _inside(places: Columns, values: list[Rows], spec: OctreeSpec) -> tuple[Columns, list[Rows]]:
    """Places, in leaf units, and values of the points that lie in the cube and have finite values."""
    # Mostly all points are, which a few numbers tell: a NaN makes any of them NaN, and no comparison holds.
    lie_inside = places.size and places.min() >= 0 and places.max() < spec.cells_n
    if lie_inside and all(np.vdot(array, array) < np.inf for array in values):
        return places, values
    are_inside = ((places >= 0) & (places < spec.cells_n)).all(0)
    for array in values:
        are_inside &= np.isfinite(array).all(1)
    inside = np.flatnonzero(are_inside)
    return places.take(inside, axis=1), [array.take(inside, axis=0) for array in values]


def _occupied(codes: NDArray[np.int64], spec: OctreeSpec) -> tuple[NDArray[np.intp], NDArray[np.intp], int]:
    """Codes of the leaves to store, ascending; the place among them of each point's leaf; how many were dropped.

    Points in dropped leaves have the place behind the last.
    """
    present = np.zeros(8**spec.depth, bool)
    present[codes] = True
    kept = np.flatnonzero(present)
    leaf_of_code = np.empty(len(present), np.intp)  # only what is written is read: most of it is never touched
    leaf_of_code[kept] = np.arange(len(kept))
    leaf = leaf_of_code.take(codes)
    dropped_n = len(kept) - spec.leaf_capacity
    if dropped_n <= 0:
        return kept, leaf, 0
    fullest = np.argsort(-np.bincount(leaf), kind="stable")[: spec.leaf_capacity]
    fullest.sort()
    place = np.full(len(kept), spec.leaf_capacity)
    place[fullest] = np.arange(spec.leaf_capacity)
    return kept[fullest], place.take(leaf), dropped_n


def _leaf_features(leaf: NDArray[np.intp], leaves_n: int, offsets: Columns, values: list[Rows]) -> Columns:
    """``(channels, leaves)``: mean normal of length 1, signed distance and mean colour.

    Args:
        leaf: Leaf of each point; those past the end are ignored.
        leaves_n: Number of leaves.
        offsets: From the leaf's centre to each point, in leaf units.
        values: Normals, and colours if any, of the points.
    """
    x, y, z = offsets
    directions, *colours = (array.T for array in values)
    # In the order of the features, with z in the place of the distance, which is computed there.
    columns = [x, y, *directions, z, *(column for array in colours for column in array)]
    sums = np.array([np.bincount(leaf, column, leaves_n) for column in columns], np.float64)[:, :leaves_n]
    counts = np.bincount(leaf, minlength=leaves_n)[:leaves_n]
    normals, features = sums[2:5], sums[2:]
    lengths = np.sqrt(normals[0] * normals[0] + normals[1] * normals[1] + normals[2] * normals[2])
    if lengths.min(initial=np.inf) < _SHORTEST_NORMAL_SUM:
        for index in np.flatnonzero(lengths < _SHORTEST_NORMAL_SUM):
            normals[:, index], lengths[index] = values[0][np.argmax(leaf == index)], 1.0
    normals /= lengths
    sums[5] = sums[0] * normals[0] + sums[1] * normals[1] + sums[5] * normals[2]
    sums[5] /= counts * HALF_DIAGONAL
    sums[6:] /= counts
    return features


def _frame(codes: NDArray[np.intp], features: Columns, spec: OctreeSpec) -> OctreeFrame:
    """The padded frame of ascending codes and features ``(channels, leaves)``."""
    padded_codes = np.full(spec.leaf_capacity, PADDING, _NUMPY_TYPES[spec.code_dtype])
    padded_codes[: len(codes)] = codes
    padded_features = np.zeros((spec.leaf_capacity, spec.channels), np.float32)
    padded_features[: len(codes)] = features.T
    # Torch converts to float16 faster than numpy, and a TensorDict is made faster than a tensorclass.
    stored = {
        "codes": torch.from_numpy(padded_codes),
        "features": torch.from_numpy(padded_features).half(),
    }
    return OctreeFrame.from_tensordict(TensorDict(stored, []))
