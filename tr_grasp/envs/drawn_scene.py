"""A scene as SAPIEN's renderer draws it: the same bodies in the same colours as the ray caster's."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import sapien
from numpy.typing import NDArray
from sapien import render

from tr_grasp.envs.picture import SUN
from tr_grasp.sensing import Body
from tr_grasp.sensing.look import GroundTexture
from tr_grasp.sensing.sapien_bodies import render_body, render_ground

Array = NDArray[np.floating]
GROUND_HALF_SIDE_M = 1.0


def light_scene(scene: sapien.Scene) -> None:
    """A sun with shadows, a weaker light from the other side, and some from everywhere; for photographs alone."""
    scene.set_ambient_light([0.35, 0.36, 0.38])
    _add_sun(scene, -SUN, (1.5, 1.45, 1.35), shadow=True)
    _add_sun(scene, np.array([-0.6, 0.4, -0.7]), (0.5, 0.52, 0.55), shadow=False)


def _add_sun(scene: sapien.Scene, direction: Array, colour: tuple[float, float, float], *, shadow: bool) -> None:
    """Light that falls in one direction (3,), with the shadows of what is near the robot if wanted."""
    sun = render.RenderDirectionalLightComponent()
    sun.color = colour
    sun.shadow, sun.shadow_near, sun.shadow_far, sun.shadow_half_size = shadow, -2.0, 2.0, 1.2
    sun.shadow_map_size = 2048
    # Lights shine along x.
    forward = direction / np.linalg.norm(direction)
    left = np.cross([0.0, 0.0, 1.0], forward)
    left /= np.linalg.norm(left)
    T = np.eye(4)
    T[:3, :3] = np.stack([forward, left, np.cross(forward, left)], axis=1)
    entity = sapien.Entity()
    entity.add_component(sun)
    entity.set_pose(sapien.Pose(T))
    scene.add_entity(entity)


class DrawnScene:
    """Gives a scene that can render its robot and its ground; objects bring their own looks.

    Args:
        scene: The scene; its origin is the robot's base frame.
        links: The robot's links and what they look like.
    """

    def __init__(self, scene: sapien.Scene, links: Sequence[tuple[sapien.Entity, Body]]) -> None:
        self._scene = scene
        self._ground: sapien.Entity | None = None
        for entity, body in links:
            loaded = entity.find_component_by_type(render.RenderBodyComponent)
            if loaded is not None:
                entity.remove_component(loaded)
            entity.add_component(render_body(body))

    def lay(self, ground: GroundTexture) -> None:
        """Put this ground in the place of the one before."""
        if self._ground is not None:
            self._scene.remove_entity(self._ground)
        self._ground = sapien.Entity()
        self._ground.name = "ground"
        self._ground.add_component(render_ground(ground, GROUND_HALF_SIDE_M))
        self._scene.add_entity(self._ground)
