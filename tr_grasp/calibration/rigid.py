"""Small motions of rigid bodies, many at once: six numbers, translation [m] before rotation vector [rad]."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from tr_grasp.geometry import invert_transform, transform_from

Array = NDArray[Any]
"""Of any number: pictures and pixels too."""


def small_motion(T: Array) -> Array:
    """(*batch, 6) of transforms (*batch, 4, 4)."""
    vectors = Rotation.from_matrix(T[..., :3, :3].reshape(-1, 3, 3)).as_rotvec()
    return np.concatenate([T[..., :3, 3], vectors.reshape(*T.shape[:-2], 3)], axis=-1)


def transform_of(motion: ArrayLike) -> Array:
    """(*batch, 4, 4) of small motions (*batch, 6); undoes :func:`small_motion`."""
    motion = np.asarray(motion, float)
    T = np.zeros((*motion.shape[:-1], 4, 4))
    T[..., :3, :3] = Rotation.from_rotvec(motion[..., 3:].reshape(-1, 3)).as_matrix().reshape(*motion.shape[:-1], 3, 3)
    T[..., :3, 3] = motion[..., :3]
    T[..., 3, 3] = 1.0
    return T


def mean_transform(T: Array) -> Array:
    """(4, 4) of transforms (n, 4, 4) nearly the same: the middle one in each coordinate of a small motion."""
    about = transform_from(
        Rotation.from_matrix(T[:, :3, :3]).mean().as_matrix(),
        np.median(T[:, :3, 3], axis=0),
    )
    return about @ transform_of(np.median(small_motion(invert_transform(about) @ T), axis=0))


def adjoint(T: Array) -> Array:
    """(*batch, 6, 6) that carries a small motion through ``T``: ``T · d(x) ≈ d(adjoint(T) x) · T`` to first order."""
    R, Ad = T[..., :3, :3], np.zeros((*T.shape[:-2], 6, 6))
    Ad[..., :3, :3] = Ad[..., 3:, 3:] = R
    Ad[..., :3, 3:] = skew(T[..., :3, 3]) @ R
    return Ad


def skew(vectors: Array) -> Array:
    """(*batch, 3, 3) with ``skew(a) @ b == a × b``."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    zero = np.zeros_like(x)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def distance_m(T_a: Array, T_b: Array) -> float:
    """Between the origins of two transforms (4, 4)."""
    return float(np.linalg.norm(T_a[:3, 3] - T_b[:3, 3]))


def angle_rad(T_a: Array, T_b: Array) -> float:
    """Of the rotation between two transforms (4, 4)."""
    return float(Rotation.from_matrix(T_a[:3, :3].T @ T_b[:3, :3]).magnitude())
