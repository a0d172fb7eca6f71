"""What devices report. Every reading says at what time of its world's clock it was true."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]


@dataclass(frozen=True, eq=False)
class ArmState:
    """Measured joints.

    Attributes:
        stamp_s: When.
        q_rad, dq_rad_s, effort_nm: (dof,) position, speed and torque.
        fault: Why it does not move, for people; empty if it is ready.
    """

    stamp_s: float
    q_rad: Array
    dq_rad_s: Array
    effort_nm: Array
    fault: str = ""


@dataclass(frozen=True)
class GripperState:
    """Measured fingers.

    Attributes:
        stamp_s: When.
        opening_m: Distance between the pads.
        force_n: Force with which they press.
        moving: The fingers are on their way.
        holding: An object stopped them.
        fault: Why they do not move, for people; empty if they are ready.
    """

    stamp_s: float
    opening_m: float
    force_n: float = 0.0
    moving: bool = False
    holding: bool = False
    fault: str = ""


@dataclass(frozen=True)
class Intrinsics:
    """A pinhole camera without distortion, axes as in OpenCV; pixel (0, 0) has its centre there [px]."""

    width_px: int
    height_px: int
    fx: float
    fy: float
    cx: float
    cy: float

    @property
    def matrix(self) -> Array:
        """K (3, 3)."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])


@dataclass(frozen=True, eq=False)
class RGBDImage:
    """A colour picture and the depth of each of its pixels.

    Attributes:
        stamp_s: When it was exposed.
        frame: Name of the camera's optical frame.
        rgb: (h, w, 3) uint8.
        depth_m: (h, w) float32 along the optical axis; NaN where nothing was measured.
        intrinsics: Of both.
    """

    stamp_s: float
    frame: str
    rgb: NDArray[np.uint8] = field(repr=False)
    depth_m: NDArray[np.float32] = field(repr=False)
    intrinsics: Intrinsics


@dataclass(frozen=True, eq=False)
class PoseReading:
    """Where something was.

    Attributes:
        stamp_s: When it was there, not when the reading arrived.
        T_base_object: (4, 4).
    """

    stamp_s: float
    T_base_object: Array = field(repr=False)
