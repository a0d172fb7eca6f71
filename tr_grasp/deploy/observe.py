"""From a camera's picture to what a policy of Task I observes: the same pipeline as in the environment."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDict

from tr_grasp import keys
from tr_grasp.configs import EnvCfg
from tr_grasp.errors import HardwareError
from tr_grasp.hardware import Intrinsics, RGBDImage
from tr_grasp.octree import OctreeFrame, OctreeSpec, octree_from_points
from tr_grasp.sensing import DepthImage, PinholeCamera, point_cloud_from_image

Array = NDArray[np.floating]
STAGES_N = 4


@dataclass(frozen=True, eq=False)
class CalibratedCamera(PinholeCamera):
    """A pinhole camera with the intrinsics of a real one; its ``fov_rad`` is not used."""

    intrinsics: Intrinsics | None = None

    @classmethod
    def of(cls, intrinsics: Intrinsics, T_base_cam: Array) -> CalibratedCamera:
        """The camera that took a picture."""
        i = intrinsics
        fov = 2 * float(np.arctan(i.height_px / 2 / i.fy))
        return cls(T_base_cam, fov, i.width_px, i.height_px, i)

    @cached_property
    def directions_cam(self) -> Array:
        """(h, w, 3) directions through the pixel centres with z = 1."""
        i = self.intrinsics
        assert i is not None
        x, y = (np.arange(i.width_px) - i.cx) / i.fx, (np.arange(i.height_px) - i.cy) / i.fy
        return np.stack([*np.meshgrid(x, y), np.ones((i.height_px, i.width_px))], axis=-1)


class Observer:
    """Builds observations and stacks them on those before.

    Args:
        cfg: The task that the policy was trained for.
        T_base_cam: (4, 4) where the camera is, from a calibration.
    """

    def __init__(self, cfg: EnvCfg, T_base_cam: Array) -> None:
        w, o = cfg.workspace, cfg.observation
        x, y, z = (c - w.side_m / 2 for c in w.centre_m)
        origin = (x, y, z)
        self.spec = OctreeSpec(origin, w.side_m, o.depth, o.leaf_capacity, o.colour)
        self._lower = np.array(origin)
        self._upper = self._lower + w.side_m
        self._T_base_cam, self._camera = np.asarray(T_base_cam, float), None
        self._stack: deque[tuple[torch.Tensor, ...]] = deque(maxlen=o.stack_n)

    def frame(self, image: RGBDImage) -> OctreeFrame:
        """The octree of a picture.

        Raises:
            HardwareError: Nothing of the workspace can be seen.
        """
        if self._camera is None or self._camera.intrinsics != image.intrinsics:
            self._camera = CalibratedCamera.of(image.intrinsics, self._T_base_cam)
        depth = np.where(np.isfinite(image.depth_m), image.depth_m, np.inf).astype(np.float32)
        colour = image.rgb.astype(np.float32) / 255
        cloud = point_cloud_from_image(DepthImage(depth, colour), self._camera, self._lower, self._upper)
        if not len(cloud.points):
            raise HardwareError("the camera sees nothing in the workspace; check its pose and what is in its way.")
        return octree_from_points(cloud.points, cloud.normals, cloud.colours, self.spec)

    def observe(self, image: RGBDImage, proprio: Array) -> TensorDict:
        """What the policy reads; the first picture fills the stack."""
        frame = self.frame(image)
        newest = (frame.codes, frame.features, torch.from_numpy(np.asarray(proprio, np.float32)))
        while len(self._stack) < (self._stack.maxlen or 1) - 1:
            self._stack.append(newest)
        self._stack.append(newest)
        codes, features, senses = (torch.stack(column) for column in zip(*self._stack, strict=True))
        octree = OctreeFrame(codes=codes, features=features, batch_size=[len(self._stack)])
        return TensorDict({keys.OCTREE: octree, keys.PROPRIO: senses, keys.STAGES: torch.zeros(STAGES_N)}, [])
