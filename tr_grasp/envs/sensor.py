"""The task's eye: a depth camera and the octree of what it sees."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from tr_grasp.configs import EnvCfg
from tr_grasp.octree import OctreeFrame, OctreeSpec, octree_from_points
from tr_grasp.sensing import DepthImage, PinholeCamera, RaycastScene, point_cloud_from_image
from tr_grasp.sensing.noise import with_gaussian_depth_noise

Array = NDArray[np.floating]
PICTURE_EYE_M, PICTURE_TARGET_M = (1.05, -0.62, 0.52), (0.45, 0.0, 0.12)
SUN = np.array([0.35, -0.45, 0.82])


def octree_spec(cfg: EnvCfg) -> OctreeSpec:
    """The cube of a task's octrees."""
    w, o = cfg.workspace, cfg.observation
    origin = tuple(c - w.side_m / 2 for c in w.centre_m)
    return OctreeSpec(origin_m=origin, side_m=w.side_m, depth=o.depth, leaf_capacity=o.leaf_capacity, colour=o.colour)


class OctreeSensor:
    """Takes pictures with the configured camera and builds their octrees.

    Args:
        cfg: The task.
        capture: Takes a noise-free picture with a camera.
    """

    def __init__(self, cfg: EnvCfg, capture: Callable[[PinholeCamera], DepthImage]) -> None:
        self._capture = capture
        self.spec = octree_spec(cfg)
        self._noise_m = cfg.camera.depth_noise_m
        self._camera = PinholeCamera.looking_at(
            cfg.camera.eye_m, cfg.camera.target_m, cfg.camera.fov_rad, cfg.camera.image_size_px
        )
        self._lower = np.array(self.spec.origin_m)
        self._upper = self._lower + self.spec.side_m

    def observe(self, rng: np.random.Generator) -> OctreeFrame:
        """The octree of the present instant; depth noise is drawn from ``rng``."""
        image = with_gaussian_depth_noise(self._capture(self._camera), self._noise_m, rng)
        cloud = point_cloud_from_image(image, self._camera, self._lower, self._upper)
        return octree_from_points(cloud.points, cloud.normals, cloud.colours, self.spec)


def picture(scene: RaycastScene, poses: Array, size_px: int) -> NDArray[np.uint8]:
    """A shaded (size, size, 3) picture of the workspace, with the shadow of one sun."""
    camera = PinholeCamera.looking_at(PICTURE_EYE_M, PICTURE_TARGET_M, 0.62, size_px)
    rays = camera.rays_base
    hits = scene.cast(rays, poses)
    seen = hits.body >= 0
    normals = np.where((hits.normals * rays[:, 3:]).sum(1, keepdims=True) > 0, -hits.normals, hits.normals)
    points = rays[:, :3] + rays[:, 3:] * np.where(seen, hits.distance, 0.0)[:, None]
    to_sun = np.concatenate([points + 1e-3 * normals, np.broadcast_to(SUN, points.shape)], axis=1).astype(np.float32)
    lit = ~np.isfinite(scene.cast(to_sun, poses).distance)
    brightness = 0.45 + 0.55 * np.clip(normals @ SUN, 0, 1) * np.where(lit, 1.0, 0.25)
    colour = np.where(seen[:, None], hits.colours * brightness[:, None], hits.colours)
    return (255 * np.clip(colour, 0, 1)).astype(np.uint8).reshape(size_px, size_px, 3)
