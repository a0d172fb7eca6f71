"""What can be seen of a simulated scene: by the policy's camera, by the expert from above, and by people."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
import sapien
from numpy.typing import NDArray

from tr_grasp.configs import EnvCfg
from tr_grasp.envs.picture import picture
from tr_grasp.envs.robot_bodies import table_body
from tr_grasp.envs.sensor import task_camera, wanted_pixels
from tr_grasp.grasps import HeightMap, height_map
from tr_grasp.sensing import Body, DepthImage, RaycastCamera, RaycastScene
from tr_grasp.sensing.sapien_camera import SapienCamera

Array = NDArray[np.floating]
Seen = tuple[sapien.Entity, Body]
"""What moves, and what it looks like."""


class SceneView:
    """Looks at the present instant of a scene.

    Args:
        cfg: The task.
        scene: The simulated scene; its origin is the robot's base frame.
        links: The robot's links.
        objects: The objects, in order.
    """

    def __init__(self, cfg: EnvCfg, scene: sapien.Scene, links: Sequence[Seen], objects: Sequence[Seen]) -> None:
        self._cfg, self._scene = cfg, scene
        self._entities = [entity for entity, _ in [*links, *objects]]
        self._objects = range(len(links), len(self._entities))
        self.raycast = RaycastScene([body for _, body in [*links, *objects]], still=[table_body()])

    def poses(self) -> Array:
        """(moving, 4, 4) ``T_base_body`` of the links and then the objects."""
        return np.stack([entity.pose.to_transformation_matrix() for entity in self._entities])

    def object_poses(self) -> Array:
        """(objects, 4, 4) ``T_base_object``."""
        return np.stack([self._entities[i].pose.to_transformation_matrix() for i in self._objects])

    def capture(self) -> DepthImage:
        """A noise-free picture by the task's camera, of what may lie in the octree's cube."""
        if self._cfg.camera.backend == "sapien":
            return self._sapien_camera.capture()
        return self._raycast_camera.capture(self.poses())

    def picture(self, size_px: int) -> NDArray[np.uint8]:
        """A shaded (size, size, 3) picture for people."""
        return picture(self.raycast, self.poses(), size_px)

    def height_map(self) -> HeightMap:
        """Table and objects from above, without the robot."""
        w = self._cfg.workspace
        return height_map(self.raycast, self.poses(), self._objects, w.centre_m[:2], w.side_m + 0.08)

    @cached_property
    def _raycast_camera(self) -> RaycastCamera:
        return RaycastCamera(self.raycast, task_camera(self._cfg), wanted_pixels(self._cfg))

    @cached_property
    def _sapien_camera(self) -> SapienCamera:
        return SapienCamera(self._scene, task_camera(self._cfg))
