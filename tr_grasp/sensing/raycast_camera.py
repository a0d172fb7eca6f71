"""A camera without a graphics driver."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tr_grasp.sensing.camera import DepthImage, PinholeCamera
from tr_grasp.sensing.look import Look, ground_colours
from tr_grasp.sensing.raycast import RaycastScene, RayHits

Array = NDArray[np.floating]
NEAR_M = 1e-3


class RaycastCamera:
    """One camera in a scene: what never moves is cast once, what moves only where it may be seen.

    Colours are those of the surfaces (albedo), unless the look has a light.

    Args:
        scene: What is looked at; what never moves in it is the ground.
        camera: Pose and intrinsics.
        wanted: (h, w) pixels that matter, all by default; moving bodies may be missing from the others.
        look: Texture of the ground, and light.
    """

    def __init__(
        self,
        scene: RaycastScene,
        camera: PinholeCamera,
        wanted: NDArray[np.bool_] | None = None,
        look: Look | None = None,
    ) -> None:
        self._scene, self._camera, self._look = scene, camera, look or Look()
        self._shape = (camera.height_px, camera.width_px)
        self._wanted = np.ones(self._shape, bool) if wanted is None else wanted
        still = range(scene.moving_n, scene.moving_n + scene.still_n)
        hits = scene.cast(camera.rays_base, np.zeros((0, 4, 4)), still)
        self._distance, self._colours = hits.distance, self._still_colours(hits)

    def capture(self, poses: Array) -> DepthImage:
        """Take a picture of the moving bodies at ``poses`` (moving, 4, 4) before those that never move."""
        depth, colour = self._distance.copy(), self._colours.copy()
        bodies, pixels = self._seen(poses)
        rays = self._camera.rays_base[pixels]
        hits = self._scene.cast(rays, poses, bodies)
        nearer = hits.distance < depth[pixels]
        depth[pixels[nearer]] = hits.distance[nearer]
        colour[pixels[nearer]] = self._lit(hits, hits.colours, rays)[nearer]
        return DepthImage(depth.reshape(self._shape), colour.reshape(*self._shape, 3))

    def _still_colours(self, hits: RayHits) -> Array:
        """(h * w, 3) colours of the ground."""
        colours, pixels = hits.colours, np.flatnonzero((hits.body >= 0) & self._wanted.ravel())
        if self._look.ground is not None:
            colours = colours.copy()
            colours[pixels] = ground_colours(self._look.ground, self._camera, pixels)
        return self._lit(hits, colours, self._camera.rays_base)

    def _lit(self, hits: RayHits, colours: Array, rays: Array) -> Array:
        """(n, 3) colours of what was hit, in the light if there is one."""
        if self._look.light is None:
            return colours
        away = (hits.normals * rays[:, 3:]).sum(axis=1, keepdims=True) > 0
        normals = np.where(away, -hits.normals, hits.normals) * (hits.body >= 0)[:, None]
        return self._look.light.shaded(colours, normals)

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
