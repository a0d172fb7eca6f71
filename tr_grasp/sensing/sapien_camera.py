"""The same pictures from SAPIEN's renderer, where a Vulkan device exists."""

from __future__ import annotations

import numpy as np
import sapien
from sapien import render

from tr_grasp.sensing.camera import DepthImage, PinholeCamera

# SAPIEN's cameras look along x with z up: the columns are its axes in OpenCV's.
R_CAM_SAPIEN = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])


class SapienCamera:
    """A camera in a scene that can render.

    Args:
        scene: A scene with a render system; its origin is the robot's base frame.
        camera: Pose and intrinsics.
        near_m, far_m: Depths that are seen.
    """

    def __init__(self, scene: sapien.Scene, camera: PinholeCamera, near_m: float = 0.01, far_m: float = 10.0) -> None:
        self._scene, self._far = scene, far_m
        # The shader pack is global, and ManiSkill's own cameras leave one there that draws no float positions.
        render.set_camera_shader_dir("default")
        self._component = render.RenderCameraComponent(camera.width_px, camera.height_px)
        self._component.set_fovy(camera.fov_rad, compute_x=True)
        self._component.near, self._component.far = near_m, far_m
        T = camera.T_base_cam.copy()
        T[:3, :3] = T[:3, :3] @ R_CAM_SAPIEN
        entity = sapien.Entity()
        entity.add_component(self._component)
        entity.set_pose(sapien.Pose(T))
        scene.add_entity(entity)

    def capture(self) -> DepthImage:
        """Take a picture of the present instant."""
        self._scene.update_render()
        self._component.take_picture()
        # "Position" holds OpenGL camera coordinates and, in its last channel, the depth buffer: 1 where nothing is.
        position = self._component.get_picture("Position")
        depth = np.where(position[..., 3] < 1, -position[..., 2], np.inf).astype(np.float32)
        return DepthImage(depth, self._component.get_picture("Color")[..., :3].astype(np.float32))
