"""A camera without a graphics driver."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tr_grasp.sensing.camera import DepthImage, PinholeCamera
from tr_grasp.sensing.raycast import RaycastScene

Array = NDArray[np.floating]
NEAR_M = 1e-3


class RaycastCamera:
    """One camera in a scene: what never moves is cast once, what moves only where it may be seen.

    Args:
        scene: What is looked at.
        camera: Pose and intrinsics.
        wanted: (h, w) pixels that matter, all by default; moving bodies may be missing from the others.
    """

    def __init__(self, scene: RaycastScene, camera: PinholeCamera, wanted: NDArray[np.bool_] | None = None) -> None:
        self._scene, self._camera = scene, camera
        self._shape = (camera.height_px, camera.width_px)
        self._wanted = np.ones(self._shape, bool) if wanted is None else wanted
        still = range(scene.moving_n, scene.moving_n + scene.still_n)
        self._still = scene.cast(camera.rays_base, np.zeros((0, 4, 4)), still)

    def capture(self, poses: Array) -> DepthImage:
        """Take a picture of the moving bodies at ``poses`` (moving, 4, 4) before those that never move."""
        depth, colour = self._still.distance.copy(), self._still.colours.copy()
        bodies, pixels = self._seen(poses)
        hits = self._scene.cast(self._camera.rays_base[pixels], poses, bodies)
        nearer = hits.distance < depth[pixels]
        depth[pixels[nearer]] = hits.distance[nearer]
        colour[pixels[nearer]] = hits.colours[nearer]
        return DepthImage(depth.reshape(self._shape), colour.reshape(*self._shape, 3))

    def _seen(self, poses: Array) -> tuple[list[int], NDArray[np.integer]]:
        """Moving bodies in the picture, and the flat indices of the wanted pixels that can show one of them."""
        bodies, shown = [], np.zeros(self._shape, bool)
        for body, (left, top, right, bottom) in enumerate(self._rectangles(poses)):
            if self._wanted[top:bottom, left:right].any():
                bodies.append(body)
                shown[top:bottom, left:right] = True
        return bodies, np.flatnonzero(shown & self._wanted)

    def _rectangles(self, poses: Array) -> list[list[int]]:
        """Left, top, right and bottom [px], ends excluded, of what each body can cover; widened by up to a pixel."""
        T_base_cam, size = self._camera.T_base_cam, np.array(self._shape[::-1])
        corners_cam = (self._scene.box_corners(poses) - T_base_cam[:3, 3]) @ T_base_cam[:3, :3]
        depth = corners_cam[..., 2:]
        pixels = corners_cam[..., :2] / np.maximum(depth, NEAR_M) * self._camera.focal_px + size / 2
        first, last = np.floor(pixels.min(axis=1) - 0.5), np.floor(pixels.max(axis=1) + 0.5) + 1
        # A box that reaches behind the camera has no rectangle.
        beside = (depth < NEAR_M).any(axis=1)
        first, last = np.where(beside, 0, first), np.where(beside, size, last)
        return np.clip(np.concatenate([first, last], axis=1), 0, np.tile(size, 2)).astype(int).tolist()
