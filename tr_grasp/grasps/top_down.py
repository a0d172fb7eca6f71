"""Top-down grasps of a two-finger gripper from a height map of the scene.

A vertical gripper that descends collides exactly where the map is higher than the part of the gripper above it, so
maxima over the footprints of fingers and palm decide how deep each grasp may go. What stands between the fingers at
that depth gives the width, and how its two flanks run along the pads says whether they would slip.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, maximum_filter1d

Array = NDArray[np.floating]


@dataclass(frozen=True)
class GripperShape:
    """A parallel gripper seen from above; u is the closing direction, w across it. Defaults: Franka hand.

    Attributes:
        opening_m: Distance between the open fingers.
        finger_thickness_m, pad_width_m: Size of a finger along u and w.
        tip_below_tcp_m: How far the fingertips reach below the tcp.
        palm_above_tcp_m: Height of the palm over the tcp.
        palm_u_m, palm_w_m: Half extents of the palm.
        clearance_m: Space kept between gripper and scene.
    """

    opening_m: float = 0.08
    finger_thickness_m: float = 0.018
    pad_width_m: float = 0.018
    tip_below_tcp_m: float = 0.0095
    palm_above_tcp_m: float = 0.037
    palm_u_m: float = 0.10
    palm_w_m: float = 0.032
    clearance_m: float = 0.003


@dataclass(frozen=True)
class HeightMap:
    """The scene from above, on a square grid of the base frame.

    Attributes:
        height: (n, n) highest surface [m] at cell (i, j) with x = x0 + i * cell, y = y0 + j * cell.
        owner: (n, n) index of the object that this surface belongs to, -1 for the table.
        origin_m: (x0, y0) centre of cell (0, 0).
        cell_m: Edge of a cell.
    """

    height: Array
    owner: NDArray[np.integer]
    origin_m: tuple[float, float]
    cell_m: float


@dataclass(frozen=True)
class TopDownGrasps:
    """Grasps, best first; base frame.

    Attributes:
        position: (k, 3) tcp [m].
        yaw_rad: (k,) direction of closing in the table's plane, in [0, pi).
        width_m: (k,) what stands between the fingers.
        score: (k,) in about [0, 1].
        owner: (k,) object.
    """

    position: Array
    yaw_rad: Array
    width_m: Array
    score: Array
    owner: NDArray[np.integer]

    def __len__(self) -> int:
        return len(self.score)


def top_down_grasps(
    scene: HeightMap,
    centres: Array,
    *,
    gripper: GripperShape = GripperShape(),
    lowest_tcp_m: float = 0.012,
    yaws_n: int = 16,
    per_object_n: int = 12,
) -> TopDownGrasps:
    """The best grasps of every object that can be reached from above without collision.

    Args:
        scene: The scene from above.
        centres: (objects, 2) horizontal centre of mass of each object [m].
        gripper: Its shape.
        lowest_tcp_m: Lowest tcp above the table.
        yaws_n: Closing directions tried, over half a turn.
        per_object_n: Grasps kept for each object, at most one per 12 mm and closing direction.
    """
    found = [_grasps_at(scene, centres, yaw, gripper, lowest_tcp_m) for yaw in np.arange(yaws_n) * np.pi / yaws_n]
    everything = TopDownGrasps(*(np.concatenate(column) for column in zip(*found, strict=True)))
    kept = [_diverse(everything, owner, per_object_n) for owner in range(len(centres))]
    order = np.concatenate(kept).astype(int) if kept else np.zeros(0, int)
    order = order[np.argsort(-everything.score[order], kind="stable")]
    return TopDownGrasps(*(column[order] for column in _columns(everything)))


def _columns(grasps: TopDownGrasps) -> tuple[Array, ...]:
    return grasps.position, grasps.yaw_rad, grasps.width_m, grasps.score, grasps.owner


def _grasps_at(
    scene: HeightMap, centres: Array, yaw: float, gripper: GripperShape, lowest_tcp_m: float
) -> tuple[Array, ...]:
    """All grasps with one closing direction, as columns of :class:`TopDownGrasps`."""
    cell = scene.cell_m
    height, owner, x, y = _turned(scene, yaw)
    slab = maximum_filter1d(height, _odd(gripper.pad_width_m / cell), axis=1, mode="nearest")
    half = round(gripper.opening_m / 2 / cell)
    thickness = int(np.ceil(gripper.finger_thickness_m / cell))
    fingers = _max_over_offsets(slab, half, half + thickness)
    between = maximum_filter1d(slab, 2 * (half - 1) + 1, axis=0, mode="nearest")
    palm = maximum_filter(
        height, (_odd(2 * gripper.palm_u_m / cell), _odd(2 * gripper.palm_w_m / cell)), mode="nearest"
    )
    tcp = np.maximum.reduce(
        [
            fingers + gripper.tip_below_tcp_m + gripper.clearance_m,
            palm - gripper.palm_above_tcp_m + gripper.clearance_m,
            between - (gripper.palm_above_tcp_m - gripper.clearance_m),
            np.full_like(height, lowest_tcp_m),
        ]
    )
    engaged = between - (tcp - gripper.tip_below_tcp_m)
    i, j = np.nonzero(engaged > 0.006)
    inside = (i >= half) & (i < len(height) - half)
    i, j = i[inside], j[inside]
    left, right, flat, slope = _flanks(height, slab, i, j, tcp[i, j], half, cell)
    width = (right - left + 1) * cell
    centred = np.abs(left + right) <= 2
    # Flanks that meet the pads at 45 degrees are a corner: it turns out of the grip.
    graspable = centred & (flat > 0.3) & (width <= gripper.opening_m - 0.006) & (right >= left)
    i, j, left, right, flat, slope, width = (v[graspable] for v in (i, j, left, right, flat, slope, width))
    held = owner[np.clip(i + left, 0, len(owner) - 1), j]
    held = np.where(held >= 0, held, owner[np.clip(i + right, 0, len(owner) - 1), j])
    same = (held >= 0) & (owner[np.clip(i + right, 0, len(owner) - 1), j] == held)
    i, j, left, right, flat, slope, width, held = (v[same] for v in (i, j, left, right, flat, slope, width, held))
    shift = (left + right) / 2 * cell
    position = np.stack([x[i, j] + shift * np.cos(yaw), y[i, j] + shift * np.sin(yaw), tcp[i, j]], axis=1)
    off_centre = np.linalg.norm(position[:, :2] - centres[held], axis=1) if len(held) else np.zeros(0)
    score = (
        0.45 * np.minimum(engaged[i, j], 0.04) / 0.04
        + 0.35 * flat
        + 0.20 * np.clip(1 - off_centre / 0.06, -1, 1)
        - 0.15 * np.clip((width - 0.06) / 0.014, 0, 1)
        - 0.40 * np.clip(slope - 0.3, 0, 1)
    )
    return position, np.full(len(score), yaw), width, score, held


def _turned(scene: HeightMap, yaw: float) -> tuple[Array, NDArray[np.integer], Array, Array]:
    """Height, owner, x and y on a grid whose first axis is the closing direction."""
    n = len(scene.height)
    offsets = (np.arange(n) - (n - 1) / 2) * scene.cell_m
    middle = np.array(scene.origin_m) + (n - 1) / 2 * scene.cell_m
    u, w = np.meshgrid(offsets, offsets, indexing="ij")
    x = middle[0] + u * np.cos(yaw) - w * np.sin(yaw)
    y = middle[1] + u * np.sin(yaw) + w * np.cos(yaw)
    i = np.rint((x - scene.origin_m[0]) / scene.cell_m).astype(int)
    j = np.rint((y - scene.origin_m[1]) / scene.cell_m).astype(int)
    on_map = (i >= 0) & (i < n) & (j >= 0) & (j < n)
    i, j = np.clip(i, 0, n - 1), np.clip(j, 0, n - 1)
    return np.where(on_map, scene.height[i, j], 0.0), np.where(on_map, scene.owner[i, j], -1), x, y


def _odd(cells: float) -> int:
    return 2 * int(cells / 2) + 1


def _max_over_offsets(values: Array, first: int, last: int) -> Array:
    """Highest value at distances ``first..last`` along the first axis, on either side; the table (0) beyond it."""
    padded = np.pad(values, ((last, last), (0, 0)))
    # window[k] is the maximum of padded[k : k + length], and padded[k + last] is values[k].
    window = np.lib.stride_tricks.sliding_window_view(padded, last - first + 1, axis=0).max(axis=-1)
    start = np.arange(len(values)) + last
    return np.maximum(window[start + first], window[start - last])


def _flanks(
    height: Array, slab: Array, i: NDArray[np.integer], j: NDArray[np.integer], tcp: Array, half: int, cell: float
) -> tuple[NDArray[np.integer], NDArray[np.integer], Array, Array]:
    """What the pads meet.

    Returns:
        First and last cell relative to i; how parallel the flanks run to the pads (0..1); by how much the flanks
        spread for each metre downwards, above about 1 of which friction no longer holds.
    """
    offsets = np.arange(-half + 1, half)
    # The pads meet what rises above the middle between fingertip and tcp.
    grip = (tcp - 0.004)[:, None]
    rows = np.clip(i[:, None] + offsets, 0, len(height) - 1)
    left, right = _ends(slab[rows, j[:, None]] > grip)
    edges = []
    for across in (-2, 0, 2):
        column = np.clip(j + across, 0, height.shape[1] - 1)[:, None]
        solid = height[rows, column] > grip
        a, b = _ends(solid)
        edges.append(np.where(solid.any(1), [a, b], 10 * half))
    spread = np.ptp(np.stack(edges), axis=0)
    flat = np.clip(1.25 - spread.max(axis=0) / 4.0, 0.0, 1.0)
    upper_left, upper_right = _ends(slab[rows, j[:, None]] > grip + 0.010)
    narrower = ((right - left) - (upper_right - upper_left)) / 2 * cell
    missing = upper_right - upper_left >= 2 * half - 2  # nothing reaches the upper level
    return left - half + 1, right - half + 1, flat, np.where(missing, 0.0, narrower / 0.010)


def _ends(solid: NDArray[np.bool_]) -> tuple[NDArray[np.integer], NDArray[np.integer]]:
    """Index of the first and of the last True along the second axis."""
    return solid.argmax(1), solid.shape[1] - 1 - solid[:, ::-1].argmax(1)


def _diverse(grasps: TopDownGrasps, owner: int, limit: int) -> NDArray[np.integer]:
    """Indices of the best grasps of one object, thinned to one per 12 mm and closing direction."""
    candidates = np.flatnonzero(grasps.owner == owner)
    candidates = candidates[np.argsort(-grasps.score[candidates], kind="stable")]
    place = np.floor(grasps.position[candidates, :2] / 0.012).astype(int)
    keys = np.column_stack([place, np.rint(grasps.yaw_rad[candidates] / (np.pi / 64)).astype(int)])
    _, first = np.unique(keys, axis=0, return_index=True)
    return candidates[np.sort(first)[:limit]]
