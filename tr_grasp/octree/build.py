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
    places = _columns({"points": position_array}, points_n, np.float64)
    others = {"normals": _as_numpy("normals", normals)}
    if spec.colour:
        others["colours"] = _as_numpy("colours", colours)
    values = _columns(others, points_n, np.float32)
    places -= np.array(spec.origin_m)[:, None]
    places *= 1 / spec.leaf_m
    places, values = _inside(places, values, spec)
    cells = np.floor(places)
    places -= cells
    places -= 0.5  # positions now count from the leaf's centre, in leaf units
    kept, leaf, dropped_n = _occupied(code_of_cells(cells, spec.depth), spec)
    frame = _frame(kept, _leaf_features(leaf, len(kept), [*places, *values]), spec)
    return OctreeBuild(frame, points_n - len(leaf), dropped_n)


def _columns(arrays: dict[str, NDArray[Any]], points_n: int, dtype: type[np.floating]) -> Columns:
    """``(3 * arrays, n)``: the arrays under each other, one contiguous row for each of their columns."""
    columns = np.empty((3 * len(arrays), points_n), dtype)
    for start, (name, array) in zip(range(0, len(columns), 3), arrays.items(), strict=True):
        if array.shape != (points_n, 3):
            raise ValueError(f"{name} must have shape ({points_n}, 3), one row for each point; got {array.shape}.")
        columns[start : start + 3] = array.T
    return columns


def _as_numpy(name: str, value: ArrayLike | Tensor | None) -> NDArray[Any]:
    if isinstance(value, Tensor):
        value = value.detach().cpu()
        value = (value.float() if value.dtype == torch.bfloat16 else value).numpy()  # numpy has no bfloat16
    array = np.asarray(value)
    if array.dtype.kind not in "fiu":
        raise ValueError(f"{name} must hold real numbers, got {'None' if value is None else array.dtype}.")
    return array


def _inside(places: Columns, values: Columns, spec: OctreeSpec) -> tuple[Columns, Columns]:
    """The columns of points that lie in the cube and have finite values; places are in leaf units."""
    # Mostly all points are, which a few numbers tell: a NaN makes any of them NaN, and no comparison holds.
    if places.size and places.min() >= 0 and places.max() < spec.cells_n and np.vdot(values, values) < np.inf:
        return places, values
    inside = np.flatnonzero(((places >= 0) & (places < spec.cells_n)).all(0) & np.isfinite(values).all(0))
    return places.take(inside, axis=1), values.take(inside, axis=1)


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


def _leaf_features(leaf: NDArray[np.intp], leaves_n: int, columns: list[Columns]) -> Columns:
    """``(channels, leaves)``: mean normal of length 1, signed distance and mean colour.

    Args:
        leaf: Leaf of each point; those past the end are ignored.
        leaves_n: Number of leaves.
        columns: Of the points: offsets from the leaf's centre in leaf units (3), normals (3), colours (3 or none).
    """
    sums = np.array([np.bincount(leaf, column, leaves_n) for column in columns], np.float64)[:, :leaves_n]
    counts = np.bincount(leaf, minlength=leaves_n)[:leaves_n]
    offsets, normals, colours = sums[:3], sums[3:6], sums[6:]
    lengths = np.sqrt((normals * normals).sum(0))
    for index in np.flatnonzero(lengths < _SHORTEST_NORMAL_SUM):
        first = np.argmax(leaf == index)
        normals[:, index], lengths[index] = [column[first] for column in columns[3:6]], 1.0
    normals /= lengths
    distances = (offsets * normals).sum(0) / (counts * HALF_DIAGONAL)
    return np.concatenate([normals, distances[None], colours / counts])


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
