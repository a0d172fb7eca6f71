"""Where the task's camera stands, and whether it can see from there."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from tr_grasp.configs import CameraArcCfg, EnvCfg
from tr_grasp.errors import ConfigError
from tr_grasp.geometry import invert_transform, transform_points
from tr_grasp.objects import ObjectModel
from tr_grasp.sensing import PinholeCamera

Array = NDArray[np.floating]
DRAWS_N = 1000


def random_camera(cfg: EnvCfg, rng: np.random.Generator) -> PinholeCamera:
    """A camera on ``cfg.camera.arc`` that looks at the workspace's centre.

    Raises:
        ConfigError: The arc lies behind the robot.
    """
    c, centre = cfg.camera, np.array(cfg.workspace.centre_m)
    eye = centre + rng.uniform(*c.arc.distance_m) * random_direction(c.arc, rng)
    return PinholeCamera.looking_at(eye, centre, c.fov_rad, c.image_size_px)


def random_direction(arc: CameraArcCfg, rng: np.random.Generator) -> Array:
    """A unit vector (3,) from the workspace's centre to a camera, drawn again while it points behind the robot.

    Raises:
        ConfigError: A thousand draws all pointed there.
    """
    lower, upper = np.transpose([arc.direction_x, arc.direction_y, arc.direction_z])
    for _ in range(DRAWS_N):
        direction = rng.uniform(lower, upper)
        if np.pi - abs(np.arctan2(direction[1], direction[0])) >= arc.behind_robot_rad:
            return direction / np.linalg.norm(direction)
    raise ConfigError(
        f"camera.arc with direction_x {arc.direction_x} and direction_y {arc.direction_y} lies within "
        f"behind_robot_rad {arc.behind_robot_rad:.3f} of straight behind the robot; widen the directions or lower it."
    )


def require_view(camera: PinholeCamera, lower_m: Array, upper_m: Array) -> None:
    """Refuse a camera that looks past the octree's cube, given by two corners (3,) [m].

    Raises:
        ConfigError: No pixel's ray meets the cube.
    """
    if not camera.pixels_that_meet(lower_m, upper_m).any():
        eye = _text(camera.T_base_cam[:3, 3])
        raise ConfigError(
            f"the camera at {eye} m looks past the workspace's cube from {_text(lower_m)} to {_text(upper_m)} m; "
            "change camera.eye_m, camera.target_m or workspace.centre_m."
        )


def require_outside(camera: PinholeCamera, objects: Iterable[tuple[ObjectModel, Array]]) -> None:
    """Refuse a camera inside an object.

    Args:
        camera: The camera.
        objects: Objects and their ``T_base_object`` (4, 4).

    Raises:
        ConfigError: It is inside of one, which is named.
    """
    eye = camera.T_base_cam[:3, 3]
    for model, T_base_object in objects:
        if np.linalg.norm(eye - T_base_object[:3, 3]) > model.diagonal_m:
            continue
        eye_object = transform_points(invert_transform(T_base_object), eye)
        if any(_is_inside(part.vertices[part.faces], eye_object) for part in model.parts):
            raise ConfigError(
                f"the camera at {_text(eye)} m is inside the object {model.name!r}; "
                "move camera.eye_m, or raise camera.arc.distance_m."
            )


def _is_inside(triangles: Array, point: Array) -> bool:
    """Whether a point (3,) lies in the convex hull with these outward triangles (f, 3, 3)."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    return bool((((point - triangles[:, 0]) * normals).sum(axis=1) <= 0).all())


def _text(point: Array) -> str:
    return "(" + ", ".join(f"{value:.3f}" for value in point) + ")"
