"""What hand-eye calibration is computed from: where the robot was, and where the camera saw the board then."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from tr_grasp.calibration.rigid import Array
from tr_grasp.errors import CalibrationError

Setup = Literal["eye_on_base", "eye_in_hand"]
SETUPS: tuple[Setup, ...] = ("eye_on_base", "eye_in_hand")


@dataclass(frozen=True, eq=False)
class Sample:
    """One pose of the robot with one sight of the board.

    Attributes:
        name: How reports call it.
        T_base_tcp: (4, 4) pose of the frame that moves, as the robot tells it; any frame fixed to the hand will do.
        T_cam_board: (4, 4) pose of the board, as the camera sees it.
        information: (6, 6) of ``T_cam_board`` per squared pixel; nothing where only poses are known.
        pixels, points_board: (n, 2) [px] and (n, 3) [m] corners; nothing where only poses are known.
        reprojection_px: Error of the corners under ``T_cam_board``.
        q_rad: (dof,) joints of the robot, if known.
    """

    name: str
    T_base_tcp: Array
    T_cam_board: Array
    information: Array | None = None
    pixels: Array | None = None
    points_board: Array | None = None
    reprojection_px: float | None = None
    q_rad: Array | None = None

    def __post_init__(self) -> None:
        for name in ("T_base_tcp", "T_cam_board"):
            object.__setattr__(self, name, rigid(f"{name} of sample {self.name}", getattr(self, name)))


def rigid(what: str, T: Array) -> Array:
    """A transform (4, 4) with its rotation made exact.

    Raises:
        CalibrationError: Another shape, NaN, or no rigid transform (rotations may be 1e-3 off, as printed numbers are).
    """
    T = np.array(T, float)
    if T.shape != (4, 4) or not np.isfinite(T).all():
        raise CalibrationError(f"{what} must be a finite transform (4, 4), got an array of shape {T.shape}.")
    R = T[:3, :3]
    if np.abs(R.T @ R - np.eye(3)).max() > 1e-3 or np.linalg.det(R) < 0 or np.abs(T[3] - [0, 0, 0, 1]).max() > 1e-6:
        raise CalibrationError(f"{what} is not rigid: it must hold a rotation, and 0, 0, 0, 1 in its last row.")
    U, _, V = np.linalg.svd(R)
    T[:3, :3] = U @ V
    return T


def base_tcp(samples: Sequence[Sample]) -> Array:
    """(n, 4, 4) ``T_base_tcp`` of samples."""
    return np.array([sample.T_base_tcp for sample in samples]).reshape(-1, 4, 4)


def cam_board(samples: Sequence[Sample]) -> Array:
    """(n, 4, 4) ``T_cam_board`` of samples."""
    return np.array([sample.T_cam_board for sample in samples]).reshape(-1, 4, 4)
