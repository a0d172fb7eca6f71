"""What callers may pass: finite numbers, as many as the arm has joints. Everything else is refused in one sentence."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tr_grasp.errors import MotionError, unknown_name

Array = NDArray[np.floating]
Flags = NDArray[np.bool_]


def joint_vector(name: str, value: ArrayLike, dof: int) -> Array:
    """Joint values (dof,) as float64.

    Raises:
        MotionError: Another shape, or NaN or infinity in it.
    """
    return _finite(name, value, (dof,), f"one number for each of the {dof} joints")


def joint_rows(name: str, value: ArrayLike, dof: int) -> Array:
    """Joint values (n, dof) as float64, n ≥ 1; a single vector is one row.

    Raises:
        MotionError: Another shape, no row, or NaN or infinity in it.
    """
    rows = np.atleast_2d(np.asarray(value, float))
    if rows.ndim != 2 or not len(rows):
        raise MotionError(f"{name} must be rows of {dof} joints (n, {dof}), got an array of shape {rows.shape}.")
    return _finite(name, rows, (len(rows), dof), f"{dof} joints in every row")


def transforms(name: str, value: ArrayLike) -> Array:
    """Rigid transforms (*batch, 4, 4) as float64.

    Raises:
        MotionError: Another shape, NaN, or no rotation in it (rotations may be 1e-4 off, as float32 is).
    """
    T = np.asarray(value, float)
    if T.ndim < 2 or T.shape[-2:] != (4, 4):
        raise MotionError(f"{name} must be homogeneous transforms (*batch, 4, 4), got an array of shape {T.shape}.")
    if not np.isfinite(T).all():
        raise MotionError(f"{name} must be finite, got NaN or infinity.")
    R = T[..., :3, :3]
    straight = np.abs(R.swapaxes(-1, -2) @ R - np.eye(3)).max(initial=0.0) < 1e-4
    if not straight or (np.linalg.det(R) < 0).any() or np.abs(T[..., 3, :] - [0, 0, 0, 1]).max(initial=0.0) > 1e-6:
        raise MotionError(f"{name} must hold rotations and the last row 0, 0, 0, 1; this matrix is not rigid.")
    return T


def positive(name: str, value: float) -> float:
    """A finite number above zero.

    Raises:
        MotionError: It is not.
    """
    if not np.isfinite(value) or value <= 0:
        raise MotionError(f"{name} must be positive, got {value}.")
    return float(value)


def one_of(what: str, given: str, valid: Iterable[str]) -> str:
    """A name out of a fixed set.

    Raises:
        MotionError: It is another; the sentence holds the valid ones.
    """
    names = tuple(valid)
    if given not in names:
        raise MotionError(unknown_name(what, str(given), names))
    return given


def _finite(name: str, value: ArrayLike, shape: tuple[int, ...], rule: str) -> Array:
    array = np.asarray(value, float)
    if array.shape != shape:
        raise MotionError(f"{name} must hold {rule}, got an array of shape {array.shape}.")
    if not np.isfinite(array).all():
        raise MotionError(f"{name} must be finite, got NaN or infinity.")
    return array
