"""How a colour camera maps points to pixels; what its maker or its driver says."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from tr_grasp.calibration.rigid import Array
from tr_grasp.errors import CalibrationError


@dataclass(frozen=True)
class Intrinsics:
    """A pinhole camera with OpenCV's distortion; the middle of the first pixel is at (0, 0)."""

    width_px: int = 640
    """Width of the picture."""

    height_px: int = 480
    """Height of the picture."""

    fx_px: float = 616.0
    """Focal length along a row."""

    fy_px: float = 616.0
    """Focal length along a column."""

    cx_px: float = 319.5
    """Where the optical axis meets the picture, along a row."""

    cy_px: float = 239.5
    """Where the optical axis meets the picture, along a column."""

    distortion: tuple[float, ...] = ()
    """OpenCV's k1, k2, p1, p2, k3 and so on; none for rectified pictures and RealSense colour."""

    def __post_init__(self) -> None:
        if min(self.width_px, self.height_px) < 16 or min(self.fx_px, self.fy_px) <= 0:
            raise CalibrationError("a camera needs a picture of 16 pixels or more and positive focal lengths.")
        if len(self.distortion) not in (0, 4, 5, 8, 12, 14):
            raise CalibrationError(
                f"distortion must hold 0, 4, 5, 8, 12 or 14 numbers as in OpenCV, got {len(self.distortion)}."
            )

    @property
    def matrix(self) -> Array:
        """(3, 3) camera matrix."""
        return np.array([[self.fx_px, 0.0, self.cx_px], [0.0, self.fy_px, self.cy_px], [0.0, 0.0, 1.0]])

    @property
    def coefficients(self) -> Array:
        """Distortion as OpenCV takes it; zeros where there is none."""
        return np.array(self.distortion or (0.0,) * 5)

    def project(self, points_cam: Array) -> Array:
        """Pixels (n, 2) of points (n, 3) [m] in the camera's frame."""
        zero = np.zeros(3)
        pixels, _ = cv2.projectPoints(points_cam.reshape(-1, 1, 3), zero, zero, self.matrix, self.coefficients)
        return pixels.reshape(-1, 2)

    def sees(self, pixels: Array, margin_px: float = 0.0) -> bool:
        """Whether all pixels (n, 2) are inside the picture."""
        size = np.array([self.width_px, self.height_px])
        return bool((pixels >= margin_px).all() and (pixels <= size - 1 - margin_px).all())


D415_COLOUR = Intrinsics()
"""RealSense D415, colour at 640 x 480: fields of view 54.9 and 42.6 degrees (datasheet: 42 vertically)."""
