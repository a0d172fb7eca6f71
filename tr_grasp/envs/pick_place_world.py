"""A pick-and-place station in SAPIEN, and the judge of what was done in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tr_grasp.envs.sapien_station import SapienStation
from tr_grasp.envs.sapien_world import PHYSICS_HZ, Touch
from tr_grasp.envs.things import Thing
from tr_grasp.errors import ConfigError
from tr_grasp.geometry import rotation_about_z, transform_from
from tr_grasp.objects.bottle import bottle
from tr_grasp.pick_place import StationCfg
from tr_grasp.pick_place.scene import pose_of_box
from tr_grasp.sensing import PinholeCamera

OBJECT = "object"
EYE_M, EYE_FOV_RAD, EYE_PX = np.array([0.45, -0.25, 0.85]), 0.5, 240
UPRIGHT = np.cos(np.radians(20.0))
PUSHED_M = 1e-3
"""The bottle starts this much above what it stands on."""


@dataclass(frozen=True)
class Verdict:
    """What the simulator knows of a task that is over.

    Attributes:
        placed: The object's middle is inside the goal.
        touches: Of the robot or the object's holder on what must not be touched.
        object_m: (3,) where the object's middle is.
        upright: Its axis leans by less than 20 degrees.
    """

    placed: bool
    touches: tuple[Touch, ...]
    object_m: tuple[float, float, float]
    upright: bool


def pick_place_world(
    cfg: StationCfg,
    *,
    foot_m: Sequence[float] | None = None,
    yaw_rad: float = 0.0,
    camera: PinholeCamera | None = None,
    physics_hz: int = PHYSICS_HZ,
) -> SapienStation:
    """The station with its boxes and its object.

    Args:
        cfg: The station.
        foot_m: (2,) or (3,) where the object's foot really is; where the task expects it, if not given.
        yaw_rad: Turn of the object about the vertical.
        camera: If there is one.
        physics_hz: Steps per second.
    """
    x, y, z = cfg.object.foot_m if foot_m is None else (*foot_m, cfg.object.foot_m[2])[:3]
    model = bottle(cfg.object.radius_m, cfg.object.height_m)
    middle = float(z) - float(model.bounds_m[0, 2]) + PUSHED_M
    T = transform_from(rotation_about_z(yaw_rad), (float(x), float(y), middle))
    things = [
        *(Thing(name, pose_of_box(b), size_m=b.size_m, colour=b.colour) for name, b in cfg.boxes.items()),
        Thing(OBJECT, T, model=model, mass_kg=cfg.object.mass_kg, friction=cfg.object.friction),
    ]
    station = SapienStation.of(cfg.robot, things=things, camera=camera, physics_hz=physics_hz)
    if cfg.home_q_rad:
        station.arm.place(cfg.home_q_rad)
    return station


def look_camera(cfg: StationCfg) -> PinholeCamera:
    """A camera that looks down, a little from the side, at where the object is to be found.

    Raises:
        ConfigError: The station does not say where that is.
    """
    if cfg.search_m is None:
        raise ConfigError("the station has no search_m, the region in which to look.")
    middle = np.mean(cfg.search_m, axis=0)
    return PinholeCamera.looking_at(middle + EYE_M, middle, EYE_FOV_RAD, EYE_PX)


def judge(station: SapienStation, cfg: StationCfg) -> Verdict:
    """Where the object is now and what was touched since the report of touches began."""
    T = station.world.true_pose(OBJECT)
    middle = T[:3, 3]
    inside = cfg.goal_m is not None and all(
        low <= value <= high for value, low, high in zip(middle, *cfg.goal_m, strict=True)
    )
    touches = tuple(touch for touch in station.world.touches if touch.thing in cfg.not_to_touch)
    return Verdict(bool(inside), touches, tuple(np.round(middle, 4).tolist()), bool(T[2, 2] > UPRIGHT))
