"""Points to a stored octree."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
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


CHUNK_POINTS = 16_384
"""Clouds are built together as long as they have no more points than that: enough to share the cost of the calls, and
few enough for their columns of numbers to stay in the processor's caches (50 000 take three times as long a point)."""

Cloud = tuple[ArrayLike | Tensor, ArrayLike | Tensor, ArrayLike | Tensor | None]
"""Points, normals and colours, as :func:`octree_from_points` takes them."""


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
        _warn_of_dropped_leaves(spec)
    return built.frame


def count_octree_from_points(
    points: ArrayLike | Tensor, normals: ArrayLike | Tensor, colours: ArrayLike | Tensor | None, spec: OctreeSpec
) -> OctreeBuild:
    """``octree_from_points`` that counts what it leaves out instead of warning of it."""
    slots = _Slots.unoccupied((), spec)
    ignored_n, dropped_n = _fill([slots], [_checked((points, normals, colours), spec)], spec)
    return OctreeBuild(slots.frames(), ignored_n, dropped_n)


def octrees_from_clouds(clouds: Sequence[Cloud], spec: OctreeSpec) -> OctreeFrame:
    """Frames ``(len(clouds),)``: ``octree_from_points`` of every cloud, several times as fast as one by one.

    Args:
        clouds: Points, normals and colours of each; they may differ in their numbers of points.
        spec: The cube.

    Raises:
        ValueError: As ``octree_from_points``, with the cloud's place in the batch.

    Warns:
        LeafOverflowWarning: If leaves of any frame were left out.
    """
    slots = _Slots.unoccupied((len(clouds),), spec)
    checked = []
    for index, cloud in enumerate(clouds):
        try:
            checked.append(_checked(cloud, spec))
        except ValueError as error:
            raise ValueError(f"cloud {index}: {error}") from error
    dropped_n = 0
    for chunk in _chunks([len(points) for points, *_ in checked]):
        dropped_n += _fill([slots.of(index) for index in chunk], [checked[index] for index in chunk], spec)[1]
    if dropped_n:
        _warn_of_dropped_leaves(spec)
    return slots.frames()


class _Slots(NamedTuple):
    """What frames are made from, while they are filled."""

    codes: NDArray[np.integer]
    """``(*batch, leaf_capacity)``"""

    features: NDArray[np.float32]
    """``(*batch, leaf_capacity, channels)``"""

    @classmethod
    def unoccupied(cls, batch_size: tuple[int, ...], spec: OctreeSpec) -> _Slots:
        shape = (*batch_size, spec.leaf_capacity)
        return cls(
            np.full(shape, PADDING, _NUMPY_TYPES[spec.code_dtype]), np.zeros((*shape, spec.channels), np.float32)
        )

    def of(self, index: int) -> _Slots:
        return _Slots(self.codes[index], self.features[index])

    def frames(self) -> OctreeFrame:
        # Torch converts to float16 faster than numpy, and a TensorDict is made faster than a tensorclass.
        stored = {"codes": torch.from_numpy(self.codes), "features": torch.from_numpy(self.features).half()}
        return OctreeFrame.from_tensordict(TensorDict(stored, list(self.codes.shape[:-1])))


def _warn_of_dropped_leaves(spec: OctreeSpec) -> None:
    # The text is always the same, so that Python shows it once and not for each of a million frames.
    warnings.warn(
        f"More leaves are occupied than leaf_capacity={spec.leaf_capacity}; those with the most points stay. "
        "Raise leaf_capacity or lower depth.",
        LeafOverflowWarning,
        stacklevel=3,
    )


def _checked(cloud: Cloud, spec: OctreeSpec) -> list[NDArray[Any]]:
    """Points, normals and, if the spec stores them, colours, each ``(n, 3)``."""
    if len(cloud) != 3:
        raise ValueError(f"a cloud is points, normals and colours (or None), got {len(cloud)} of them.")
    names = ("points", "normals", "colours") if spec.colour else ("points", "normals")
    arrays = [_as_numpy(name, values) for name, values in zip(names, cloud, strict=False)]
    points_n = len(arrays[0]) if arrays[0].ndim else 0
    for name, array in zip(names, arrays, strict=True):
        if array.shape != (points_n, 3):
            raise ValueError(f"{name} must have shape ({points_n}, 3), one row for each point; got {array.shape}.")
    return arrays


def _chunks(points_n: Sequence[int]) -> Iterator[list[int]]:
    """Places of clouds that are built together: of neighbours, as many as ``CHUNK_POINTS`` allow, one at least."""
    chunk: list[int] = []
    sum_n = 0
    for index, n in enumerate(points_n):
        if chunk and sum_n + n > CHUNK_POINTS:
            yield chunk
            chunk, sum_n = [], 0
        chunk.append(index)
        sum_n += n
    if chunk:
        yield chunk


def _fill(slots: Sequence[_Slots], clouds: Sequence[Sequence[NDArray[Any]]], spec: OctreeSpec) -> tuple[int, int]:
    """Put the leaves of each cloud into the slots of its frame.

    Every cloud has a range of codes of its own, one after the other, so that no step but the last knows clouds.

    Returns:
        Points that were ignored and leaves that were dropped, of all clouds together.
    """
    positions, *values = clouds[0] if len(clouds) == 1 else map(np.concatenate, zip(*clouds, strict=True))
    values = [np.asarray(array, np.float32) for array in values]
    places = positions.T.astype(np.float64, order="C")
    places -= np.array(spec.origin_m)[:, None]
    places *= 1 / spec.leaf_m
    inside = _inside(places, values, spec)
    first_codes = range(0, len(clouds) * 8**spec.depth, 8**spec.depth)
    offset = np.repeat(first_codes, [len(points) for points, *_ in clouds]) if len(clouds) > 1 else None
    if inside is not None:
        places, values = places.take(inside, axis=1), [array.take(inside, axis=0) for array in values]
        offset = None if offset is None else offset.take(inside)
    cells = np.floor(places)
    places -= cells
    places -= 0.5  # positions now count from the leaf's centre, in leaf units
    codes = code_of_cells(cells, spec.depth)
    if offset is not None:
        codes += offset
    kept, leaf, dropped_n = _occupied(codes, len(clouds), spec)
    features = _leaf_features(leaf, len(kept), places, values)
    ends = np.searchsorted(kept, first_codes[1:]) if len(clouds) > 1 else ()
    start = 0
    for target, first, end in zip(slots, first_codes, [*ends, len(kept)], strict=True):
        target.codes[: end - start] = kept[start:end] - first
        target.features[: end - start] = features[:, start:end].T
        start = end
    return len(positions) - len(leaf), dropped_n


def _as_numpy(name: str, value: ArrayLike | Tensor | None) -> NDArray[Any]:
    if isinstance(value, Tensor):
        value = value.detach().cpu()
        value = (value.float() if value.dtype == torch.bfloat16 else value).numpy()  # numpy has no bfloat16
    array = np.asarray(value)
    if array.dtype.kind not in "fiu":
        raise ValueError(f"{name} must hold real numbers, got {'None' if value is None else array.dtype}.")
    return array


def _inside(places: Columns, values: Sequence[Rows], spec: OctreeSpec) -> NDArray[np.intp] | None:
    """Points whose places, in leaf units, lie in the cube and whose values are finite; ``None`` if that is all."""
    # Mostly all points are, which a few numbers tell: a NaN makes any of them NaN, and no comparison holds.
    lie_inside = places.size and places.min() >= 0 and places.max() < spec.cells_n
    if lie_inside and all(np.vdot(array, array) < np.inf for array in values):
        return None
    are_inside = ((places >= 0) & (places < spec.cells_n)).all(0)
    for array in values:
        are_inside &= np.isfinite(array).all(1)
    return np.flatnonzero(are_inside)


def _occupied(
    codes: NDArray[np.int64], clouds_n: int, spec: OctreeSpec
) -> tuple[NDArray[np.intp], NDArray[np.intp], int]:
    """Codes of the leaves to store, ascending; the place among them of each point's leaf; how many were dropped.

    Points in dropped leaves have the place behind the last.
    """
    present = np.zeros(clouds_n * 8**spec.depth, bool)
    present[codes] = True
    kept = np.flatnonzero(present)
    leaf_of_code = np.empty(len(present), np.intp)  # only what is written is read: most of it is never touched
    leaf_of_code[kept] = np.arange(len(kept))
    leaf = leaf_of_code.take(codes)
    if len(kept) <= spec.leaf_capacity:
        return kept, leaf, 0
    cloud = kept >> 3 * spec.depth
    leaves_n = np.bincount(cloud, minlength=clouds_n)
    if leaves_n.max() <= spec.leaf_capacity:
        return kept, leaf, 0
    # Cloud by cloud, the fullest first; sorting is stable, so that of equals the smaller code is first.
    order = np.lexsort((-np.bincount(leaf), cloud))
    rank = np.arange(len(kept)) - np.repeat(np.cumsum(leaves_n) - leaves_n, leaves_n)
    stay = np.sort(order[rank < spec.leaf_capacity])
    place = np.full(len(kept), len(stay))
    place[stay] = np.arange(len(stay))
    return kept[stay], place.take(leaf), len(kept) - len(stay)


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
