"""Points with normals and colours from one depth picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tr_grasp.sensing.camera import DepthImage, PinholeCamera

Array = NDArray[np.floating]


@dataclass(frozen=True)
class PointCloud:
    """Points seen by a camera, in the robot's base frame.

    Attributes:
        points: (n, 3) float32 [m].
        normals: (n, 3) float32 unit vectors that point to the camera's side.
        colours: (n, 3) float32 in [0, 1].
    """

    points: Array
    normals: Array
    colours: Array


def point_cloud_from_image(image: DepthImage, camera: PinholeCamera, lower_m: Array, upper_m: Array) -> PointCloud:
    """Deproject a picture, estimate normals from neighbouring pixels, keep what lies inside a box.

    Args:
        image: Depth and colour, as taken by ``camera``.
        camera: Its pose and intrinsics.
        lower_m: (3,) lowest corner of the box in the base frame.
        upper_m: (3,) highest corner, excluded.
    """
    points = camera.deproject(image.depth)
    planes = np.moveaxis(points, -1, 0)
    inside = (planes >= lower_m[:, None, None]) & (planes < upper_m[:, None, None])
    pixels = np.flatnonzero(inside.all(axis=0))
    normals = normals_at(pixels, points, image.depth, camera.T_base_cam[:3, 3])
    return PointCloud(
        points.reshape(-1, 3)[pixels].astype(np.float32),
        normals.astype(np.float32),
        image.colour.reshape(-1, 3)[pixels].astype(np.float32),
    )


def normals_at(pixels: NDArray[np.integer], points: Array, depth: Array, eye: Array) -> Array:
    """(n, 3) unit normals of an organised cloud, turned towards the camera; zero where there is none.

    The tangent along each image axis is the sum of the two neighbouring differences, or the one with the smaller
    step in depth where the other crosses an edge, so that silhouettes do not bend the normals.

    Args:
        pixels: (n,) flat indices of the pixels.
        points: (h, w, 3) the cloud [m].
        depth: (h, w) the picture that it comes from [m].
        eye: (3,) where the camera is.
    """
    height, width = depth.shape
    row, column = np.divmod(pixels, width)
    planes, flat_depth = np.moveaxis(points, -1, 0).reshape(3, -1), depth.ravel()
    right, left = pixels + (column < width - 1), pixels - (column > 0)
    below, above = pixels + width * (row < height - 1), pixels - width * (row > 0)
    with np.errstate(invalid="ignore"):
        normals = _cross(
            _tangent(planes, flat_depth, pixels, left, right), _tangent(planes, flat_depth, pixels, above, below)
        )
        length = np.sqrt((normals * normals).sum(axis=0))
        away = ((planes.take(pixels, axis=1) - eye[:, None]) * normals).sum(axis=0) > 0
    normals = np.where(away, -normals, normals) / np.maximum(length, 1e-12)
    return np.where(np.isfinite(normals), normals, 0.0).T


def _tangent(
    planes: Array, depth: Array, pixels: NDArray[np.integer], before: NDArray[np.integer], after: NDArray[np.integer]
) -> Array:
    """(3, n) surface direction from the neighbours of each pixel; one without a neighbour is its own."""
    here = planes.take(pixels, axis=1)
    step_before, step_after = here - planes.take(before, axis=1), planes.take(after, axis=1) - here
    jump_before = np.abs(depth[pixels] - depth[before])
    jump_after = np.abs(depth[after] - depth[pixels])
    jump_before = np.where(np.isnan(jump_before) | (before == pixels), np.inf, jump_before)
    jump_after = np.where(np.isnan(jump_after) | (after == pixels), np.inf, jump_after)
    use_before, use_after = jump_before <= 2 * jump_after + 0.002, jump_after <= 2 * jump_before + 0.002
    return np.where(use_before, step_before, 0.0) + np.where(use_after, step_after, 0.0)


def _cross(a: Array, b: Array) -> Array:
    # numpy.cross spends most of its time on checks for arrays this small.
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
