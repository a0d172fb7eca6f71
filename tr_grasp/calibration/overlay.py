"""A sample's picture with what was seen and what the calibration expects drawn over it."""

from __future__ import annotations

import cv2
import numpy as np

from tr_grasp.calibration.board import BoardSpec
from tr_grasp.calibration.intrinsics import Intrinsics
from tr_grasp.calibration.rigid import Array
from tr_grasp.calibration.samples import Sample

ZOOM = 2
SHIFT = 4
SEEN, EXPECTED = (64, 220, 130), (255, 92, 80)
AXES = ((240, 70, 70), (70, 200, 90), (80, 130, 250))


def draw_overlay(picture: Array, sample: Sample, T_cam_board: Array, board: BoardSpec, camera: Intrinsics) -> Array:
    """An RGB picture twice as large: corners as seen (green), board as expected (red outline and dots), its axes.

    Args:
        picture: (h, w, 3) uint8 RGB.
        sample: With corners.
        T_cam_board: (4, 4) where the calibration expects the board.
        board: The board.
        camera: The camera.
    """
    shown = cv2.resize(np.ascontiguousarray(picture), None, fx=ZOOM, fy=ZOOM, interpolation=cv2.INTER_CUBIC)
    outline = _pixels(board.outline_board, T_cam_board, camera)
    cv2.polylines(shown, [_fixed(outline)], True, EXPECTED, 2, cv2.LINE_AA, SHIFT)
    if sample.points_board is not None and sample.pixels is not None:
        for corner in _fixed(sample.pixels):
            cv2.circle(shown, corner.tolist(), 6 << SHIFT, SEEN, 2, cv2.LINE_AA, SHIFT)
        for corner in _fixed(_pixels(sample.points_board, T_cam_board, camera)):
            cv2.circle(shown, corner.tolist(), 2 << SHIFT, EXPECTED, -1, cv2.LINE_AA, SHIFT)
    ends = _fixed(_pixels(np.vstack([np.zeros(3), 0.05 * np.eye(3)]), T_cam_board, camera))
    for end, colour in zip(ends[1:], AXES, strict=True):
        cv2.line(shown, ends[0].tolist(), end.tolist(), colour, 3, cv2.LINE_AA, SHIFT)
    return shown


def expected_error_px(sample: Sample, T_cam_board: Array, camera: Intrinsics) -> float | None:
    """Root mean square distance between corners as seen and as expected; nothing where only poses are known."""
    if sample.points_board is None or sample.pixels is None:
        return None
    gaps = _pixels(sample.points_board, T_cam_board, camera) - sample.pixels
    return float(np.sqrt((gaps**2).sum(1).mean()))


def _pixels(points_board: Array, T_cam_board: Array, camera: Intrinsics) -> Array:
    return camera.project(points_board @ T_cam_board[:3, :3].T + T_cam_board[:3, 3])


def _fixed(pixels: Array) -> Array:
    """Pixels of the picture as OpenCV's fixed-point pixels of the enlarged one."""
    return np.rint(((pixels + 0.5) * ZOOM - 0.5) * (1 << SHIFT)).astype(np.int32)
