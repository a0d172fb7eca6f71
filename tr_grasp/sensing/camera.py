"""A pinhole camera and the picture it takes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tr_grasp.geometry import look_at, rotate_points

Array = NDArray[np.floating]


@dataclass(frozen=True)
class DepthImage:
    """What a depth camera returns.

    Attributes:
        depth: (h, w) float32, distance along the optical axis [m]; ``inf`` where nothing was hit.
        colour: (h, w, 3) float32 in [0, 1].
    """

    depth: Array
    colour: Array


@dataclass(frozen=True, eq=False)
class PinholeCamera:
    """Square pixels, principal point in the middle, axes as in OpenCV.

    Attributes:
        T_base_cam: (4, 4) pose of the camera in the robot's base frame.
        fov_rad: Full vertical field of view.
        width_px, height_px: Size of the picture.
    """

    T_base_cam: Array
    fov_rad: float
    width_px: int
    height_px: int

    @classmethod
    def looking_at(cls, eye_m: ArrayLike, target_m: ArrayLike, fov_rad: float, size_px: int) -> PinholeCamera:
        """A square picture taken from ``eye_m`` towards ``target_m`` (base frame)."""
        return cls(look_at(eye_m, target_m), fov_rad, size_px, size_px)

    @property
    def focal_px(self) -> float:
        """Focal length in pixels."""
        return self.height_px / 2 / float(np.tan(self.fov_rad / 2))

    @cached_property
    def directions_cam(self) -> Array:
        """(h, w, 3) directions through the pixel centres with z = 1, so a distance along them is a depth."""
        x = (np.arange(self.width_px) + 0.5 - self.width_px / 2) / self.focal_px
        y = (np.arange(self.height_px) + 0.5 - self.height_px / 2) / self.focal_px
        return np.stack([*np.meshgrid(x, y), np.ones((self.height_px, self.width_px))], axis=-1)

    @cached_property
    def rays_base(self) -> NDArray[np.float32]:
        """(h * w, 6) origin and direction of each pixel's ray in the base frame, row by row."""
        directions = rotate_points(self.T_base_cam[:3, :3], self.directions_cam.reshape(-1, 3))
        origins = np.broadcast_to(self.T_base_cam[:3, 3], directions.shape)
        return np.concatenate([origins, directions], axis=1).astype(np.float32)

    def deproject(self, depth: Array) -> Array:
        """(h, w, 3) points [m] in the base frame for a depth picture (h, w) [m]; ``inf`` stays ``inf`` or NaN."""
        with np.errstate(invalid="ignore"):
            points = self._origins + self._directions * depth.ravel()
        # Each coordinate is a plane of its own in memory: numpy is several times faster along planes than across.
        return points.T.reshape(self.height_px, self.width_px, 3)

    def pixels_that_meet(self, lower_m: Array, upper_m: Array) -> NDArray[np.bool_]:
        """(h, w) pixels whose ray meets the box between two corners (3,) of the base frame."""
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.stack(
                [(np.asarray(end)[:, None] - self._origins) / self._directions for end in (lower_m, upper_m)]
            )
        # A ray inside the plane of a face gives NaN, which says nothing about that axis.
        enter, leave = np.nanmax(ends.min(axis=0), axis=0), np.nanmin(ends.max(axis=0), axis=0)
        return ((enter <= leave) & (leave >= 0)).reshape(self.height_px, self.width_px)

    @cached_property
    def _origins(self) -> NDArray[np.float32]:
        """(3, h * w) origins of the rays."""
        return np.ascontiguousarray(self.rays_base[:, :3].T)

    @cached_property
    def _directions(self) -> NDArray[np.float32]:
        """(3, h * w) directions of the rays."""
        return np.ascontiguousarray(self.rays_base[:, 3:].T)
