"""OpenCV's hand-eye solvers behind one function."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, get_args

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from tr_grasp.calibration.problem import Problem
from tr_grasp.calibration.rigid import Array, inverse, small_motion, transform_of
from tr_grasp.calibration.samples import Sample, Setup
from tr_grasp.errors import CalibrationError, unknown_name

Method = Literal["daniilidis", "park", "tsai", "horaud", "andreff", "shah", "li"]
METHODS: tuple[Method, ...] = get_args(Method)
"""``shah`` and ``li`` solve for robot-world and hand-eye at once; the others for hand-eye alone."""

_AX_XB = {
    "daniilidis": cv2.CALIB_HAND_EYE_DANIILIDIS,
    "park": cv2.CALIB_HAND_EYE_PARK,
    "tsai": cv2.CALIB_HAND_EYE_TSAI,
    "horaud": cv2.CALIB_HAND_EYE_HORAUD,
    "andreff": cv2.CALIB_HAND_EYE_ANDREFF,
}
_AX_ZB = {"shah": cv2.CALIB_ROBOT_WORLD_HAND_EYE_SHAH, "li": cv2.CALIB_ROBOT_WORLD_HAND_EYE_LI}


def solve_closed_form(samples: Sequence[Sample], setup: Setup, method: Method = "daniilidis") -> tuple[Array, Array]:
    """X and Z (4, 4) each, as :mod:`tr_grasp.calibration.problem` names them.

    Raises:
        CalibrationError: No such method, or it finds nothing in these samples.
    """
    if method not in METHODS:
        raise CalibrationError(unknown_name("method", str(method), METHODS))
    problem = Problem(samples, setup)
    hand, seen = problem.hand, problem.seen
    try:
        if method in _AX_XB:
            R, t = cv2.calibrateHandEye(*_split(hand), *_split(seen), method=_AX_XB[method])
            X = _joined(R, t)
            Z = _mean(hand @ X @ seen)
        else:
            # OpenCV's world is the board: it wants the board's pose in the camera and the base in the hand's frame.
            R_base, t_base, R_cam, t_cam = cv2.calibrateRobotWorldHandEye(
                *_split(seen), *_split(inverse(hand)), method=_AX_ZB[method]
            )
            X, Z = inverse(_joined(R_cam, t_cam)), inverse(_joined(R_base, t_base))
    except cv2.error as error:
        raise CalibrationError(f"the method {method!r} finds no solution: {error.err or error}.") from error
    if not (np.isfinite(X).all() and np.isfinite(Z).all()):
        raise CalibrationError(f"the method {method!r} finds no solution for these samples; try another.")
    return X, Z


def _split(T: Array) -> tuple[Array, Array]:
    return np.ascontiguousarray(T[:, :3, :3]), np.ascontiguousarray(T[:, :3, 3])


def _joined(R: Array, t: Array) -> Array:
    T = np.eye(4)
    # Some solvers return a matrix that is a rotation only nearly.
    U, _, V = np.linalg.svd(R)
    T[:3, :3] = U @ np.diag([1.0, 1.0, np.linalg.det(U @ V)]) @ V
    T[:3, 3] = np.ravel(t)
    return T


def _mean(T: Array) -> Array:
    """Of transforms (n, 4, 4) that are nearly the same: the middle one in each coordinate of a small motion."""
    about = np.eye(4)
    about[:3, :3] = Rotation.from_matrix(T[:, :3, :3]).mean().as_matrix()
    about[:3, 3] = np.median(T[:, :3, 3], axis=0)
    return about @ transform_of(np.median(small_motion(inverse(about) @ T), axis=0))
