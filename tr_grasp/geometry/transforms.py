"""Rotations, homogeneous transforms and camera poses."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.floating]


def rotation_about_z(angle_rad: float) -> Array:
    """``R`` (3, 3) that turns x towards y by ``angle_rad``."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def matrix_from_wxyz(q_a_b: ArrayLike) -> Array:
    """``R_a_b`` (*batch, 3, 3) of quaternions (*batch, 4) in the order w, x, y, z; they are normalised first."""
    q = np.asarray(q_a_b, float)
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    w, x, y, z = np.moveaxis(q, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def wxyz_from_matrix(R_a_b: ArrayLike) -> Array:
    """Unit quaternions (*batch, 4) in the order w, x, y, z of rotations ``R_a_b`` (*batch, 3, 3); w is not negative."""
    R = np.asarray(R_a_b, float)
    flat = Rotation.from_matrix(R.reshape(-1, 3, 3)).as_quat(canonical=True)
    return np.roll(flat, 1, axis=-1).reshape(*R.shape[:-2], 4)


def random_wxyz(rng: np.random.Generator) -> Array:
    """A unit quaternion, uniform over all rotations (a normalised 4-D Gaussian)."""
    q = rng.normal(size=4)
    return q / np.linalg.norm(q)


def transform_from(R_a_b: ArrayLike, t_a_b: ArrayLike) -> Array:
    """``T_a_b`` (4, 4) from a rotation and the position [m] of b's origin in a."""
    T = np.eye(4)
    T[:3, :3] = R_a_b
    T[:3, 3] = t_a_b
    return T


def invert_transform(T_a_b: Array) -> Array:
    """``T_b_a`` (*batch, 4, 4) of rigid ``T_a_b``."""
    T = np.zeros(T_a_b.shape)
    R = np.swapaxes(T_a_b[..., :3, :3], -1, -2)
    T[..., :3, :3] = R
    T[..., :3, 3] = -(R @ T_a_b[..., :3, 3, None])[..., 0]
    T[..., 3, 3] = 1.0
    return T


def rotate_points(R_a_b: Array, vectors_b: Array) -> Array:
    """Directions (*batch, 3) of frame b, expressed in frame a."""
    return vectors_b @ R_a_b.T


def transform_points(T_a_b: Array, points_b: Array) -> Array:
    """Points (*batch, 3) [m] of frame b, expressed in frame a."""
    return points_b @ T_a_b[:3, :3].T + T_a_b[:3, 3]


def look_at(eye: ArrayLike, target: ArrayLike, up: ArrayLike = (0.0, 0.0, 1.0)) -> Array:
    """``T_a_cam`` (4, 4) of a camera at ``eye`` that looks at ``target``, both (3,) [m] in frame a.

    Camera axes are OpenCV's: x to the right of the picture, y down, z into the scene.

    Raises:
        ValueError: If the camera looks along ``up`` or sits on its target.
    """
    z = np.asarray(target, float) - np.asarray(eye, float)
    x = np.cross(z, np.asarray(up, float))
    if np.linalg.norm(z) < 1e-9 or np.linalg.norm(x) < 1e-9 * np.linalg.norm(z):
        raise ValueError(f"a camera at {eye} cannot look at {target} with {up} upwards; move one of them")
    z = z / np.linalg.norm(z)
    x = x / np.linalg.norm(x)
    return transform_from(np.stack([x, np.cross(z, x), z], axis=1), np.asarray(eye, float))


def wrap_half_turn(angle_rad: Array | float) -> Array | float:
    """The angle in [-pi/2, pi/2) that a symmetric two-finger gripper cannot tell from ``angle_rad``."""
    return (np.asarray(angle_rad) + np.pi / 2) % np.pi - np.pi / 2
