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
    inside = ((points >= lower_m) & (points < upper_m)).all(axis=-1)
    normals = normals_from_grid(points, image.depth, camera.T_base_cam[:3, 3])
    return PointCloud(
        points[inside].astype(np.float32), normals[inside].astype(np.float32), image.colour[inside].astype(np.float32)
    )


def normals_from_grid(points: Array, depth: Array, eye: Array) -> Array:
    """(h, w, 3) unit normals of an organised cloud (h, w, 3), turned towards the camera at ``eye`` (3,).

    The tangent along each image axis is the sum of the two neighbouring differences, or the one with the smaller
    step in depth where the other crosses an edge, so that silhouettes do not bend the normals.
    """
    tangent_u = _tangent(points, depth)
    tangent_v = _tangent(points.swapaxes(0, 1), depth.T).swapaxes(0, 1)
    with np.errstate(invalid="ignore"):
        normals = _cross(tangent_u, tangent_v)
        length = np.sqrt((normals * normals).sum(axis=-1, keepdims=True))
        away = ((points - eye) * normals).sum(axis=-1, keepdims=True) > 0
    normals = np.where(away, -normals, normals) / np.maximum(length, 1e-12)
    return np.where(np.isfinite(normals), normals, 0.0)


def _tangent(points: Array, depth: Array) -> Array:
    """(h, w, 3) surface direction along the second axis."""
    with np.errstate(invalid="ignore"):
        forward = points[:, 1:] - points[:, :-1]
        jump = np.abs(depth[:, 1:] - depth[:, :-1])
    jump = np.where(np.isnan(jump), np.inf, jump)
    edge = np.full((depth.shape[0], 1), np.inf, depth.dtype)
    none = np.zeros((depth.shape[0], 1, 3), points.dtype)
    jump_left, jump_right = np.concatenate([edge, jump], 1), np.concatenate([jump, edge], 1)
    left, right = np.concatenate([none, forward], 1), np.concatenate([forward, none], 1)
    use_left = (jump_left <= 2 * jump_right + 0.002)[..., None]
    use_right = (jump_right <= 2 * jump_left + 0.002)[..., None]
    return np.where(use_left, left, 0.0) + np.where(use_right, right, 0.0)


def _cross(a: Array, b: Array) -> Array:
    # numpy.cross spends most of its time on checks for arrays this small.
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)
