"""The task's eye: a depth camera and the octree of what it sees."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from tr_grasp.configs import EnvCfg
from tr_grasp.envs.camera_pose import require_view
from tr_grasp.octree import OctreeFrame, OctreeSpec, octree_from_points
from tr_grasp.sensing import DepthImage, PinholeCamera, PointCloud, point_cloud_from_image
from tr_grasp.sensing.noise import with_depth_noise

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
    """The camera of a task that does not randomise it."""
    c = cfg.camera
    return PinholeCamera.looking_at(c.eye_m, c.target_m, c.fov_rad, c.image_size_px)


def wanted_pixels(cfg: EnvCfg, camera: PinholeCamera) -> NDArray[np.bool_]:
    """(h, w) pixels of a camera that can give a point in the cube, and their neighbours (for normals).

    Stereo noise needs whole rows, for what stands beside the cube casts a shadow into it.
    """
    meet = np.asarray(binary_dilation(camera.pixels_that_meet(*cube_corners(octree_spec(cfg)))), bool)
    return meet if cfg.randomise.depth_noise != "stereo" else meet | meet.any(axis=1, keepdims=True)


class OctreeSensor:
    """Takes pictures and builds their octrees.

    Args:
        cfg: The task.
        capture: Takes a noise-free picture with the camera.
        camera: The camera.

    Raises:
        ConfigError: The camera looks past the cube.
    """

    def __init__(self, cfg: EnvCfg, capture: Callable[[], DepthImage], camera: PinholeCamera) -> None:
        self._capture = capture
        self.spec = octree_spec(cfg)
        self._noise, self._camera_cfg, self._camera = cfg.randomise.depth_noise, cfg.camera, camera
        self._lower, self._upper = cube_corners(self.spec)
        self.image: DepthImage
        """The last picture, with its noise."""
        require_view(camera, self._lower, self._upper)

    def observe(self, rng: np.random.Generator) -> OctreeFrame:
        """The octree of the present instant; depth noise is drawn from ``rng``."""
        self.image = with_depth_noise(self._noise, self._capture(), self._camera, self._camera_cfg, rng)
        return self.octree(self.cloud())

    def cloud(self) -> PointCloud:
        """What the last picture shows of the cube."""
        return point_cloud_from_image(self.image, self._camera, self._lower, self._upper)

    def octree(self, cloud: PointCloud) -> OctreeFrame:
        """The octree of a cloud."""
        return octree_from_points(cloud.points, cloud.normals, cloud.colours, self.spec)
