"""Top-down grasps of a two-finger gripper from a height map of the scene.

A vertical gripper that descends collides exactly where the map is higher than the part of the gripper above it, so
maxima over the footprints of fingers and palm decide how deep each grasp may go. What stands between the fingers at
that depth gives the width, and how its two flanks run along the pads says whether they would slip.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import maximum_filter, maximum_filter1d

from tr_grasp.grasps.gripper_shape import FRANKA_HAND, GripperShape
from tr_grasp.grasps.height_map import HeightMap

Array = NDArray[np.floating]
Index = NDArray[np.intp]


class Grasp(NamedTuple):
    """One top-down grasp; the fields are those of :class:`TopDownGrasps`."""

    position: Array
    yaw_rad: float
    width_m: float
    depth_m: float


@dataclass(frozen=True)
class TopDownGrasps:
    """Grasps, best first; base frame.

    Attributes:
        position: (k, 3) tcp [m].
        yaw_rad: (k,) direction of closing in the table's plane, in [0, pi).
        width_m: (k,) what stands between the fingers.
        depth_m: (k,) how far the fingertips reach below the top of that.
        score: (k,) in about [0, 1].
        owner: (k,) object.
    """

    position: Array
    yaw_rad: Array
    width_m: Array
    depth_m: Array
    score: Array
    owner: NDArray[np.integer]

    def __len__(self) -> int:
        return len(self.score)

    def __getitem__(self, k: int) -> Grasp:
        return Grasp(self.position[k], float(self.yaw_rad[k]), float(self.width_m[k]), float(self.depth_m[k]))

    def subset(self, chosen: Index) -> TopDownGrasps:
        """Those with the indices ``chosen`` (m,), in that order."""
        return TopDownGrasps(
            self.position[chosen],
            self.yaw_rad[chosen],
            self.width_m[chosen],
            self.depth_m[chosen],
            self.score[chosen],
            self.owner[chosen],
        )

    @classmethod
    def joined(cls, parts: Sequence[TopDownGrasps]) -> TopDownGrasps:
        """All of several sets, one set after the other."""
        return cls(
            np.concatenate([part.position for part in parts]),
            np.concatenate([part.yaw_rad for part in parts]),
            np.concatenate([part.width_m for part in parts]),
            np.concatenate([part.depth_m for part in parts]),
            np.concatenate([part.score for part in parts]),
            np.concatenate([part.owner for part in parts]),
        )


@dataclass(frozen=True)
class Demands:
    """What a grasp must offer; the defaults hold nearly always, less is a last resort.

    Attributes:
        depth_m: How far fingertips reach below the top of what they hold.
        spare_m: By how much the open fingers are farther apart than it is wide.
        flatness: How parallel to the pads its flanks run, 0..1: at 0.25 they meet them at 45 degrees.
        corner_width_m: Width of what is held where its flanks are no flatter than ``CORNER``, in which case the
            object tends to slide out of the grip.
    """

    depth_m: float = 0.006
    spare_m: float = 0.006
    flatness: float = 0.3
    corner_width_m: float = 0.0


USUAL = Demands()
CORNER = 0.3
"""Flatness of flanks that meet the pads at about 45 degrees."""


def top_down_grasps(
    scene: HeightMap,
    centres: Array,
    *,
    gripper: GripperShape = FRANKA_HAND,
    demands: Demands = USUAL,
    lowest_tcp_m: float = 0.012,
    within_m: tuple[ArrayLike, ArrayLike] = ((-np.inf, -np.inf), (np.inf, np.inf)),
    yaws_n: int = 16,
    per_object_n: int = 64,
) -> TopDownGrasps:
    """The best grasps of every object that can be reached from above without collision.

    Args:
        scene: The scene from above.
        centres: (objects, 2) horizontal centre of mass of each object [m].
        gripper: Its shape.
        demands: What a grasp must offer.
        lowest_tcp_m: Lowest tcp above the table.
        within_m: Corners (x, y) of the rectangle in which the tcp can be.
        yaws_n: Closing directions tried, over half a turn.
        per_object_n: Grasps kept for each object, at most one per 12 mm and closing direction.
    """
    yaws = np.arange(yaws_n) * np.pi / yaws_n
    found = TopDownGrasps.joined(
        [_grasps_at(scene, centres, float(yaw), gripper, demands, lowest_tcp_m) for yaw in yaws]
    )
    xy, low, high = found.position[:, :2], np.asarray(within_m[0], float), np.asarray(within_m[1], float)
    found = found.subset(np.flatnonzero(((xy >= low) & (xy <= high)).all(axis=1)))
    order = np.concatenate([np.zeros(0, int), *(_diverse(found, k, per_object_n) for k in range(len(centres)))])
    return found.subset(order[np.argsort(-found.score[order], kind="stable")])


def _grasps_at(
    scene: HeightMap, centres: Array, yaw: float, gripper: GripperShape, demands: Demands, lowest_tcp_m: float
) -> TopDownGrasps:
    """All grasps with one closing direction."""
    cell = scene.cell_m
    half = round(gripper.opening_m / 2 / cell)
    height, owner = _turned(scene, yaw)
    pad = _odd(gripper.pad_width_m / cell)
    slab = maximum_filter1d(height, pad, axis=1, mode="nearest")
    between = maximum_filter1d(slab, 2 * (half - 1) + 1, axis=0, mode="nearest")
    tcp = _lowest_free_tcp(height, slab, between, gripper, cell, lowest_tcp_m)
    engaged = between - (tcp - gripper.tip_below_tcp_m)
    i, j = np.nonzero(engaged > demands.depth_m)
    inside = (i >= half) & (i < len(height) - half)
    i, j = i[inside], j[inside]
    # The pads meet what rises above the middle between fingertip and tcp.
    left, right = _ends_between(slab, i, j, tcp[i, j] - 0.004, half)
    wide = (right - left + 1) * cell
    kept = (np.abs(left + right) * cell <= 0.008) & (wide <= gripper.opening_m - demands.spare_m) & (right >= left)
    i, j, left, right = i[kept], j[kept], left[kept], right[kept]
    flat = _flatness(height, i, j, tcp[i, j] - 0.004, half, cell)
    if demands.flatness < CORNER:
        # Beside a corner the middle of the pad has the table under it, and an edge of the pad the object.
        owner = np.where(owner >= 0, owner, maximum_filter1d(owner, pad, axis=1, mode="nearest"))
    held, other = (owner[np.clip(i + end, 0, len(owner) - 1), j] for end in (left, right))
    width = (right - left + 1) * cell
    firm = (flat > demands.flatness) & ((flat > CORNER) | (width >= demands.corner_width_m))
    kept = (held >= 0) & (other == held) & firm
    i, j, left, right = i[kept], j[kept], left[kept], right[kept]
    flat, held, width = flat[kept], held[kept], width[kept]
    slope = _slope(slab, i, j, tcp[i, j] - 0.004, right - left, half, cell)
    middle = (len(height) - 1) / 2
    u, w = (i + (left + right) / 2 - middle) * cell, (j - middle) * cell
    x0, y0 = np.array(scene.origin_m) + middle * cell
    position = np.stack(
        [x0 + u * np.cos(yaw) - w * np.sin(yaw), y0 + u * np.sin(yaw) + w * np.cos(yaw), tcp[i, j]], axis=1
    )
    off_centre = np.linalg.norm(position[:, :2] - centres[held], axis=1) if len(held) else np.zeros(0)
    score = (
        0.45 * np.minimum(engaged[i, j], 0.04) / 0.04
        + 0.35 * flat
        + 0.20 * np.clip(1 - off_centre / 0.06, -1, 1)
        - 0.15 * np.clip((width - 0.06) / 0.014, 0, 1)
        - 0.40 * np.clip(slope - 0.3, 0, 1)
    )
    return TopDownGrasps(position, np.full(len(score), yaw), width, engaged[i, j], score, held)


def _lowest_free_tcp(
    height: Array, slab: Array, between: Array, gripper: GripperShape, cell: float, lowest_tcp_m: float
) -> Array:
    """(n, n) lowest tcp at which neither fingers nor palm touch the scene [m]."""
    half, thickness = round(gripper.opening_m / 2 / cell), int(np.ceil(gripper.finger_thickness_m / cell))
    fingers = _max_over_offsets(slab, half, half + thickness)
    palm_size = (_odd(2 * gripper.palm_u_m / cell), _odd(2 * gripper.palm_w_m / cell))
    palm = maximum_filter(height, palm_size, mode="nearest")
    return np.maximum.reduce(
        [
            fingers + gripper.tip_below_tcp_m + gripper.clearance_m,
            palm - gripper.palm_above_tcp_m + gripper.clearance_m,
            between - (gripper.palm_above_tcp_m - gripper.clearance_m),
            np.full_like(height, lowest_tcp_m),
        ]
    )


def _turned(scene: HeightMap, yaw: float) -> tuple[Array, NDArray[np.integer]]:
    """Height and owner on a grid whose first axis is the closing direction."""
    cells, on_map = _turned_cells(len(scene.height), yaw)
    return np.where(on_map, scene.height.take(cells), 0.0), np.where(on_map, scene.owner.take(cells), -1)


@lru_cache(maxsize=64)
def _turned_cells(n: int, yaw: float) -> tuple[Index, NDArray[np.bool_]]:
    """(n, n) flat index of the cell that lies at each place of the turned grid, and whether it lies on the map."""
    offsets = np.arange(n) - (n - 1) / 2
    u, w = np.meshgrid(offsets, offsets, indexing="ij")
    i = np.rint(u * np.cos(yaw) - w * np.sin(yaw) + (n - 1) / 2).astype(int)
    j = np.rint(u * np.sin(yaw) + w * np.cos(yaw) + (n - 1) / 2).astype(int)
    on_map = (i >= 0) & (i < n) & (j >= 0) & (j < n)
    return np.clip(i, 0, n - 1) * n + np.clip(j, 0, n - 1), on_map


def _odd(cells: float) -> int:
    return 2 * int(cells / 2) + 1


def _max_over_offsets(values: Array, first: int, last: int) -> Array:
    """Highest value at distances ``first..last`` along the first axis, on either side; the table (0) beyond it."""
    padded = np.pad(values, ((last, last), (0, 0)))
    # window[k] is the maximum of padded[k : k + length], and padded[k + last] is values[k].
    window = np.lib.stride_tricks.sliding_window_view(padded, last - first + 1, axis=0).max(axis=-1)
    start = np.arange(len(values)) + last
    return np.maximum(window[start + first], window[start - last])


def _ends_between(surface: Array, i: Index, j: Index, level: Array, half: int) -> tuple[Index, Index]:
    """First and last cell between the open fingers, relative to i, at which a surface is above ``level`` (k,)."""
    rows = np.clip(i[:, None] + np.arange(-half + 1, half), 0, len(surface) - 1)
    left, right = _ends(surface[rows, j[:, None]] > level[:, None])
    return left - half + 1, right - half + 1


def _flatness(height: Array, i: Index, j: Index, level: Array, half: int, cell: float) -> Array:
    """(k,) how parallel the flanks run to the pads, 0..1: compared at the middle and 8 mm to either side."""
    rows = np.clip(i[:, None] + np.arange(-half + 1, half), 0, len(height) - 1)
    edges = []
    aside = round(0.008 / cell)
    for across in (-aside, 0, aside):
        solid = height[rows, np.clip(j + across, 0, height.shape[1] - 1)[:, None]] > level[:, None]
        edges.append(np.where(solid.any(1), _ends(solid), 10 * half))
    spread = np.ptp(np.stack(edges), axis=0)
    return np.clip(1.25 - spread.max(axis=0) * cell / 0.016, 0.0, 1.0)


def _slope(slab: Array, i: Index, j: Index, level: Array, extent: Index, half: int, cell: float) -> Array:
    """(k,) by how much each flank spreads for each metre downwards; above about 1, friction no longer holds."""
    left, right = _ends_between(slab, i, j, level + 0.010, half)
    narrower = (extent - (right - left)) / 2 * cell
    missing = right - left >= 2 * half - 2  # nothing reaches the upper level
    return np.where(missing, 0.0, narrower / 0.010)


def _ends(solid: NDArray[np.bool_]) -> tuple[Index, Index]:
    """Index of the first and of the last True along the second axis."""
    return solid.argmax(1), solid.shape[1] - 1 - solid[:, ::-1].argmax(1)


def _diverse(grasps: TopDownGrasps, owner: int, limit: int) -> Index:
    """Indices of the best grasps of one object, thinned to one per 12 mm and closing direction."""
    candidates = np.flatnonzero(grasps.owner == owner)
    candidates = candidates[np.argsort(-grasps.score[candidates], kind="stable")]
    place = np.floor(grasps.position[candidates, :2] / 0.012).astype(int)
    keys = np.column_stack([place, np.rint(grasps.yaw_rad[candidates] / (np.pi / 64)).astype(int)])
    _, first = np.unique(keys, axis=0, return_index=True)
    return candidates[np.sort(first)[:limit]]
