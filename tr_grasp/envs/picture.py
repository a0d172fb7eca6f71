"""A picture for people: shaded, with a shadow, drawn without a graphics driver."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tr_grasp.sensing import PinholeCamera, RaycastScene
from tr_grasp.sensing.look import GroundTexture, ground_colours

Array = NDArray[np.floating]
PICTURE_EYE_M, PICTURE_TARGET_M, PICTURE_FOV_RAD = (1.05, -0.62, 0.52), (0.45, 0.0, 0.12), 0.62
SUN = np.array([0.35, -0.45, 0.82])


def picture_camera(size_px: int) -> PinholeCamera:
    """Where people look from."""
    return PinholeCamera.looking_at(PICTURE_EYE_M, PICTURE_TARGET_M, PICTURE_FOV_RAD, size_px)


def picture(
    scene: RaycastScene,
    poses: Array,
    size_px: int,
    ground: GroundTexture | None = None,
    camera: PinholeCamera | None = None,
) -> NDArray[np.uint8]:
    """A shaded (size, size, 3) picture of the workspace, with the shadow of one sun.

    Args:
        scene: What is drawn.
        poses: (moving, 4, 4) ``T_base_body``.
        size_px: Width and height.
        ground: Texture of what never moves; its own colour if there is none.
        camera: Takes a square picture from elsewhere.
    """
    camera = camera or picture_camera(size_px)
    rays = camera.rays_base
    hits = scene.cast(rays, poses)
    seen = hits.body >= 0
    normals = np.where((hits.normals * rays[:, 3:]).sum(1, keepdims=True) > 0, -hits.normals, hits.normals)
    points = rays[:, :3] + rays[:, 3:] * np.where(seen, hits.distance, 0.0)[:, None]
    to_sun = np.concatenate([points + 1e-3 * normals, np.broadcast_to(SUN, points.shape)], axis=1).astype(np.float32)
    lit = ~np.isfinite(scene.cast(to_sun, poses).distance)
    brightness = 0.45 + 0.55 * np.clip(normals @ SUN, 0, 1) * np.where(lit, 1.0, 0.25)
    colours = hits.colours
    if ground is not None:
        pixels = np.flatnonzero(hits.body >= scene.moving_n)
        colours[pixels] = ground_colours(ground, camera, pixels)
    colour = np.where(seen[:, None], colours * brightness[:, None], colours)
    return (255 * np.clip(colour, 0, 1)).astype(np.uint8).reshape(camera.height_px, camera.width_px, 3)
