"""The task's eye: a depth camera and the octree of what it sees."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from tr_grasp.configs import EnvCfg
from tr_grasp.octree import OctreeFrame, OctreeSpec, octree_from_points
from tr_grasp.sensing import DepthImage, PinholeCamera, point_cloud_from_image
from tr_grasp.sensing.noise import with_gaussian_depth_noise

Array = NDArray[np.floating]


def octree_spec(cfg: EnvCfg) -> OctreeSpec:
    """The cube of a task's octrees."""
    w, o = cfg.workspace, cfg.observation
    origin = tuple(c - w.side_m / 2 for c in w.centre_m)
    return OctreeSpec(origin_m=origin, side_m=w.side_m, depth=o.depth, leaf_capacity=o.leaf_capacity, colour=o.colour)


def cube_corners(spec: OctreeSpec) -> tuple[Array, Array]:
    """Lowest and highest corner (3,) of an octree's cube [m]."""
    lower = np.array(spec.origin_m)
    return lower, lower + spec.side_m


def task_camera(cfg: EnvCfg) -> PinholeCamera:
    """The camera of a task."""
    c = cfg.camera
    return PinholeCamera.looking_at(c.eye_m, c.target_m, c.fov_rad, c.image_size_px)


def wanted_pixels(cfg: EnvCfg) -> NDArray[np.bool_]:
    """(h, w) pixels of the task's camera that can give a point in the cube, and their neighbours (for normals)."""
    return binary_dilation(task_camera(cfg).pixels_that_meet(*cube_corners(octree_spec(cfg))))


class OctreeSensor:
    """Takes pictures and builds their octrees.

    Args:
        cfg: The task.
        capture: Takes a noise-free picture with the task's camera.
    """

    def __init__(self, cfg: EnvCfg, capture: Callable[[], DepthImage]) -> None:
        self._capture = capture
        self.spec = octree_spec(cfg)
        self._noise_m = cfg.camera.depth_noise_m
        self._camera = task_camera(cfg)
        self._lower, self._upper = cube_corners(self.spec)

    def observe(self, rng: np.random.Generator) -> OctreeFrame:
        """The octree of the present instant; depth noise is drawn from ``rng``."""
        image = with_gaussian_depth_noise(self._capture(), self._noise_m, rng)
        cloud = point_cloud_from_image(image, self._camera, self._lower, self._upper)
        return octree_from_points(cloud.points, cloud.normals, cloud.colours, self.spec)
