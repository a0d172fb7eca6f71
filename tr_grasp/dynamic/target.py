"""Where the object is, will be, and how sure that is: stamped readings in, poses at any time out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tr_grasp.geometry import rotation_about_z
from tr_grasp.hardware import World
from tr_grasp.prediction.predictor import Predictor, Update

Array = NDArray[np.floating]

TILT_SHARE = 0.2
"""Share of a new reading in what is known of the object's tilt; headings are the predictor's business."""
SPACING_S, FINE_S, FINE_UNTIL_S = 0.4, 0.1, 1.2
"""Times between two points of a forecast: far ahead, near, and where near ends."""


@dataclass(frozen=True, eq=False)
class Forecast:
    """Poses of an object over time: cubics through predicted positions and velocities, a tilt that stays.

    Attributes:
        times_s: (n,) of the world's clock.
        position: (n, 3) [m].
        velocity: (n, 3) [m/s].
        sigma_m: (n,) standard deviation of the position along its worst axis.
        yaw_rad: (n,) heading, without jumps.
        R_level_obj: (3, 3) what the object is turned by beside its heading.
    """

    times_s: Array
    position: Array
    velocity: Array
    sigma_m: Array
    yaw_rad: Array
    R_level_obj: Array

    def poses(self, times_s: Array) -> Array:
        """``T_base_obj`` (n, 4, 4) at times (n,)."""
        times = np.asarray(times_s, float)
        T = np.zeros((len(times), 4, 4))
        T[:, 3, 3] = 1.0
        T[:, :3, 3] = self.states(times)[0]
        yaw = np.interp(times, self.times_s, self.yaw_rad)
        c, s = np.cos(yaw), np.sin(yaw)
        T[:, 0, :3] = c[:, None] * self.R_level_obj[0] - s[:, None] * self.R_level_obj[1]
        T[:, 1, :3] = s[:, None] * self.R_level_obj[0] + c[:, None] * self.R_level_obj[1]
        T[:, 2, :3] = self.R_level_obj[2]
        return T

    def states(self, times_s: Array) -> tuple[Array, Array]:
        """Positions and velocities (n, 3) at times (n,); straight on before the first and after the last."""
        times = np.asarray(times_s, float)
        clipped = np.clip(times, self.times_s[0], self.times_s[-1])
        i = np.clip(np.searchsorted(self.times_s, clipped, side="right") - 1, 0, len(self.times_s) - 2)
        h = (self.times_s[i + 1] - self.times_s[i])[:, None]
        u = (clipped - self.times_s[i])[:, None] / h
        p0, p1, v0, v1 = self.position[i], self.position[i + 1], h * self.velocity[i], h * self.velocity[i + 1]
        a, b = 2 * (p0 - p1) + v0 + v1, 3 * (p1 - p0) - 2 * v0 - v1
        position, velocity = p0 + u * (v0 + u * (b + u * a)), (v0 + u * (2 * b + 3 * u * a)) / h
        return position + velocity * (times - clipped)[:, None], velocity

    def sigma(self, times_s: Array) -> Array:
        """(n,) standard deviation of the position along its worst axis [m]."""
        return np.interp(times_s, self.times_s, self.sigma_m)

    def yaw_rate(self, time_s: float) -> float:
        """[rad/s]."""
        ahead, back = np.interp([time_s + FINE_S / 2, time_s - FINE_S / 2], self.times_s, self.yaw_rad)
        return float(ahead - back) / FINE_S


class Target:
    """What is known of one object.

    Args:
        name: Of its readings.
        predictor: Its own; it is reset.
        looks_ahead: Without it, every forecast is that the object stays where it is.
    """

    def __init__(self, name: str, predictor: Predictor, looks_ahead: bool = True) -> None:
        self.name, self.looks_ahead = name, looks_ahead
        self._predictor = predictor
        predictor.reset()
        self._newest_s = float("-inf")
        self._R_level_obj: Array | None = None
        self._pose: Array | None = None
        self.seen_s: float | None = None
        self.readings_n = self.leaps_n = 0

    @property
    def is_known(self) -> bool:
        """There has been a reading."""
        return self._pose is not None

    @property
    def last_pose(self) -> Array:
        """``T_base_obj`` (4, 4) of the newest good reading.

        Raises:
            ValueError: There was none.
        """
        if self._pose is None:
            raise ValueError(f"nothing has been seen of {self.name!r} yet; call look() after a reading.")
        return self._pose

    def look(self, world: World) -> None:
        """Take the readings that have arrived."""
        for reading in world.poses(self.name, self._newest_s):
            self._newest_s = reading.stamp_s
            T = np.asarray(reading.T_base_object, float)
            if not np.isfinite(T).all():
                continue
            yaw = float(np.arctan2(T[1, 0], T[0, 0]))
            update = self._predictor.update(reading.stamp_s, T[:3, 3], yaw)
            if update not in (Update.TAKEN, Update.RESTARTED):
                continue
            if update is Update.RESTARTED:
                self.leaps_n += 1
                self.readings_n, self._R_level_obj = 1, None
            self.readings_n += 1
            self.seen_s, self._pose = reading.stamp_s, T
            self._lean(rotation_about_z(-yaw) @ T[:3, :3])

    def forecast(self, now_s: float, until_s: float) -> Forecast:
        """The object from now until a time that is later.

        Raises:
            ValueError: Nothing has been seen of it yet.
        """
        T, R = self.last_pose, self._R_level_obj
        assert R is not None
        near = np.arange(0.0, FINE_UNTIL_S, FINE_S)
        far = np.arange(FINE_UNTIL_S, max(until_s - now_s, FINE_UNTIL_S) + SPACING_S, SPACING_S)
        ahead = np.concatenate([near, far])
        found = self._predictor.predict(ahead if self.looks_ahead else np.zeros(1), now=max(now_s, self._newest_s))
        if not self.looks_ahead:
            n = len(ahead)
            sigma, yaw = np.zeros(n), np.full(n, np.arctan2(T[1, 0], T[0, 0]))
            return Forecast(now_s + ahead, np.tile(T[:3, 3], (n, 1)), np.zeros((n, 3)), sigma, yaw, R)
        sigma = np.sqrt(np.maximum(np.linalg.eigvalsh(found.covariance)[:, -1], 0.0))
        yaw = np.zeros(len(ahead)) if found.yaw is None else np.unwrap(found.yaw)
        return Forecast(now_s + ahead, found.position, found.velocity, sigma, yaw, R)

    def _lean(self, R_level_obj: Array) -> None:
        before = R_level_obj if self._R_level_obj is None else self._R_level_obj
        # The nearest rotation, also to a single reading: closed-form kinematics refuses those of float32.
        U, _, Vt = np.linalg.svd((1 - TILT_SHARE) * before + TILT_SHARE * R_level_obj)
        self._R_level_obj = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
