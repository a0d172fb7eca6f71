"""What can be seen of a simulated scene: by the policy's camera, by the expert from above, and by people."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
import sapien
from numpy.typing import NDArray

from tr_grasp.configs import EnvCfg
from tr_grasp.envs.drawn_scene import DrawnScene
from tr_grasp.envs.picture import picture, picture_camera
from tr_grasp.envs.robot_bodies import TABLE_COLOUR, table_body
from tr_grasp.envs.sensor import task_camera, wanted_pixels
from tr_grasp.grasps import HeightMap, height_map
from tr_grasp.sensing import Body, DepthImage, PinholeCamera, RaycastCamera, RaycastScene
from tr_grasp.sensing.look import GroundTexture, Look
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
        drawable: The scene has a renderer, which is then to draw the same as the ray caster.
    """

    def __init__(
        self,
        cfg: EnvCfg,
        scene: sapien.Scene,
        links: Sequence[Seen],
        objects: Sequence[Seen],
        drawable: bool = False,
    ) -> None:
        self._cfg, self._scene, self.look = cfg, scene, Look()
        self.camera = task_camera(cfg)
        self._seen = [*links, *objects]
        self._entities = [entity for entity, _ in self._seen]
        self._objects = range(len(links), len(self._entities))
        self.raycast = RaycastScene(self.bodies, still=[table_body()])
        self._drawn = DrawnScene(scene, links) if drawable else None

    def aim(self, camera: PinholeCamera) -> None:
        """Let the task's camera be this one from now on."""
        self.camera = camera
        self._forget_cameras()

    def dress(self, look: Look) -> None:
        """Let the scene look like this from now on, to every camera."""
        if self._drawn is not None:
            self._drawn.lay(look.ground or GroundTexture.uniform(TABLE_COLOUR))
        if look != self.look:
            self.look = look
            self._forget_cameras()

    def _forget_cameras(self) -> None:
        for name in ("_raycast_camera", "_sapien_camera"):
            camera = self.__dict__.pop(name, None)
            if isinstance(camera, SapienCamera):
                camera.remove()

    @property
    def bodies(self) -> list[Body]:
        """What moves: the links, then the objects."""
        return [body for _, body in self._seen]

    @property
    def object_indices(self) -> range:
        """Which of the bodies are objects."""
        return self._objects

    def poses(self) -> Array:
        """(moving, 4, 4) ``T_base_body`` of the links and then the objects."""
        return np.stack([entity.pose.to_transformation_matrix() for entity in self._entities])

    def object_poses(self) -> Array:
        """(objects, 4, 4) ``T_base_object``."""
        return np.stack([self._entities[i].pose.to_transformation_matrix() for i in self._objects])

    def capture(self) -> DepthImage:
        """A noise-free picture by the task's camera, of what may lie in the octree's cube."""
        if self._cfg.camera.backend == "sapien":
            return self._sapien_camera.capture(self.look.light)
        return self._raycast_camera.capture(self.poses())

    def picture(self, size_px: int) -> NDArray[np.uint8]:
        """A shaded (size, size, 3) picture for people, drawn without a graphics driver."""
        return picture(self.raycast, self.poses(), size_px, self.look.ground)

    def photograph(self, size_px: int) -> NDArray[np.uint8]:
        """The same as :meth:`picture` from SAPIEN's renderer; the scene must be drawable."""
        camera = SapienCamera(self._scene, picture_camera(size_px))
        try:
            return camera.photograph()
        finally:
            camera.remove()

    def height_map(self, cell_m: float) -> HeightMap:
        """Table and objects from above, without the robot."""
        w = self._cfg.workspace
        return height_map(self.raycast, self.poses(), self._objects, w.centre_m[:2], w.side_m + 0.08, cell_m)

    @cached_property
    def _raycast_camera(self) -> RaycastCamera:
        wanted = None if self._cfg.observation.image else wanted_pixels(self._cfg, self.camera)
        return RaycastCamera(self.raycast, self.camera, wanted, self.look)

    @cached_property
    def _sapien_camera(self) -> SapienCamera:
        return SapienCamera(self._scene, self.camera)
