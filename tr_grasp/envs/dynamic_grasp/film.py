"""Pictures of a trial while it runs, ray-cast, with what the method is doing written below."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tr_grasp.envs.dynamic_grasp.scene import DynamicScene
from tr_grasp.envs.picture import picture
from tr_grasp.sensing import PinholeCamera

Picture = NDArray[np.uint8]

EYE_M, LOOKS_AT_M, FIELD_RAD = 1.9, 0.25, 0.75
"""How far the camera is from the middle of the path and how high it looks; its field of view."""


@dataclass
class Filmed:
    """Pictures (h, w, 3) and the times [s] at which they were taken."""

    pictures: list[Picture] = field(default_factory=list)
    times_s: list[float] = field(default_factory=list)


def camera_for(distance_m: float, theta_rad: float, size_px: int) -> PinholeCamera:
    """It stands beside the path, outward and a little to the left, and sees path and arm."""
    side = theta_rad + 0.7
    middle = 0.6 * distance_m * np.array([np.cos(theta_rad), np.sin(theta_rad)])
    eye = middle + EYE_M * np.array([np.cos(side), np.sin(side)])
    return PinholeCamera.looking_at((*eye, 1.1), (*middle, LOOKS_AT_M), FIELD_RAD, size_px)


class Filming:
    """Takes a picture every ``period_s`` of the world's clock; give it to :func:`run_trial` as ``on_scene``.

    Args:
        camera: Whose eyes; the station must have one.
        period_s: Time between pictures.

    Attributes:
        film: What it took.
    """

    def __init__(self, camera: PinholeCamera, period_s: float) -> None:
        self._camera, self._period_s = camera, period_s
        self.film = Filmed()

    def __call__(self, scene: DynamicScene) -> None:
        """Begin."""
        self._scene = scene
        scene.station.world.before_step(self._before_step)

    def _before_step(self) -> None:
        now = self._scene.station.world.now_s
        if now + 1e-9 < len(self.film.times_s) * self._period_s:
            return
        seen = self._scene.station.camera
        assert seen is not None, "a trial that is filmed needs a camera"
        self.film.pictures.append(picture(seen.scene, seen.poses(), self._camera.width_px, camera=self._camera))
        self.film.times_s.append(now)
