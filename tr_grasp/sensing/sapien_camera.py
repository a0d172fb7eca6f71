"""The same pictures from SAPIEN's renderer, where a Vulkan device exists."""

from __future__ import annotations

import numpy as np
import sapien
from numpy.typing import NDArray
from sapien import render

from tr_grasp.geometry import rotate_points
from tr_grasp.sensing.camera import DepthImage, PinholeCamera
from tr_grasp.sensing.look import Light
from tr_grasp.sensing.raycast import BACKGROUND
from tr_grasp.sensing.srgb import from_linear

# SAPIEN's cameras look along x with z up: the columns are its axes in OpenCV's.
R_CAM_SAPIEN = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
R_CAM_OPENGL = np.diag([1.0, -1.0, -1.0])


class SapienCamera:
    """A camera in a scene that can render.

    Its depth pictures have the colours of the surfaces (albedo) unless a light is given, as those of
    :class:`~tr_grasp.sensing.RaycastCamera` do; the scene's own lights count in :meth:`photograph` alone.

    Args:
        scene: A scene with a render system; its origin is the robot's base frame.
        camera: Pose and intrinsics.
        near_m, far_m: Depths that are seen.
    """

    def __init__(self, scene: sapien.Scene, camera: PinholeCamera, near_m: float = 0.01, far_m: float = 10.0) -> None:
        self._scene, self._camera = scene, camera
        # The shader pack is global, and ManiSkill's own cameras leave one there that draws no float positions.
        render.set_camera_shader_dir("default")
        self._component = render.RenderCameraComponent(camera.width_px, camera.height_px)
        self._component.set_fovy(camera.fov_rad, compute_x=True)
        self._component.near, self._component.far = near_m, far_m
        T = camera.T_base_cam.copy()
        T[:3, :3] = T[:3, :3] @ R_CAM_SAPIEN
        self._entity = sapien.Entity()
        self._entity.add_component(self._component)
        self._entity.set_pose(sapien.Pose(T))
        scene.add_entity(self._entity)

    def capture(self, light: Light | None = None) -> DepthImage:
        """Take a picture of the present instant."""
        self._take()
        # "Position" holds OpenGL camera coordinates and, in its last channel, the depth buffer: 1 where nothing is.
        position = self._component.get_picture("Position")
        depth = np.where(position[..., 3] < 1, -position[..., 2], np.inf).astype(np.float32)
        colour = from_linear(self._component.get_picture("Albedo")[..., :3])
        colour = np.where(np.isfinite(depth)[..., None], colour, BACKGROUND)
        if light is not None:
            R_base_opengl = self._camera.T_base_cam[:3, :3] @ R_CAM_OPENGL
            normals = rotate_points(R_base_opengl, self._component.get_picture("Normal")[..., :3].reshape(-1, 3))
            normals = np.where(np.isfinite(depth).reshape(-1, 1), normals, 0.0)
            colour = light.shaded(colour.reshape(-1, 3), normals).reshape(colour.shape)
        return DepthImage(depth, colour)

    def photograph(self) -> NDArray[np.uint8]:
        """(h, w, 3) the present instant in the scene's own light, with its shadows."""
        self._take()
        seen = self._component.get_picture("Position")[..., 3:] < 1
        colour = np.where(seen, self._component.get_picture("Color")[..., :3], BACKGROUND)
        return (255 * np.clip(colour, 0, 1)).astype(np.uint8)

    def remove(self) -> None:
        """Take the camera out of the scene."""
        self._scene.remove_entity(self._entity)

    def _take(self) -> None:
        self._scene.update_render()
        self._component.take_picture()
