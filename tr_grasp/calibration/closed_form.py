"""Hand-eye solvers behind one function: our own dual quaternions, and OpenCV's others."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, get_args

import cv2
import numpy as np

from tr_grasp.calibration.dual_quaternions import solve_dual_quaternions
from tr_grasp.calibration.problem import Problem
from tr_grasp.calibration.rigid import Array, mean_transform
from tr_grasp.calibration.samples import Sample, Setup
from tr_grasp.errors import CalibrationError, unknown_name
from tr_grasp.geometry import invert_transform

Method = Literal["daniilidis", "park", "tsai", "horaud", "andreff", "shah", "li"]
METHODS: tuple[Method, ...] = get_args(Method)
"""``shah`` and ``li`` solve for robot-world and hand-eye at once; the others for hand-eye alone.

From noisy samples ``andreff`` and ``li``, which forget at first that a rotation has three numbers, are far worse than
the others.
"""

_AX_XB = {
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
        if method not in _AX_ZB:
            X = solve_dual_quaternions(hand, seen) if method == "daniilidis" else _opencv(hand, seen, method)
            Z = mean_transform(hand @ X @ seen)
        else:
            # OpenCV's world is the board: it wants the board's pose in the camera and the base in the hand's frame.
            R_base, t_base, R_cam, t_cam = cv2.calibrateRobotWorldHandEye(
                *_split(seen), *_split(invert_transform(hand)), method=_AX_ZB[method]
            )
            X, Z = invert_transform(_joined(R_cam, t_cam)), invert_transform(_joined(R_base, t_base))
    except cv2.error as error:
        raise CalibrationError(f"the method {method!r} finds no solution: {error.err or error}.") from error
    return X, Z


def _opencv(hand: Array, seen: Array, method: Method) -> Array:
    R, t = cv2.calibrateHandEye(*_split(hand), *_split(seen), method=_AX_XB[method])
    return _joined(R, t)


def _split(T: Array) -> tuple[Any, Any]:  # OpenCV takes arrays where it declares sequences
    return np.ascontiguousarray(T[:, :3, :3]), np.ascontiguousarray(T[:, :3, 3])


def _joined(R: Array, t: Array) -> Array:
    if not (np.isfinite(R).all() and np.isfinite(t).all()):
        raise CalibrationError("this method finds no solution for these samples; try another.")
    T = np.eye(4)
    # Some solvers return a matrix that is a rotation only nearly.
    U, _, V = np.linalg.svd(R)
    T[:3, :3] = U @ np.diag([1.0, 1.0, np.linalg.det(U @ V)]) @ V
    T[:3, 3] = np.ravel(t)
    return T
