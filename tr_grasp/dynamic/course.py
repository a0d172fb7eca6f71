"""What a hand does from its pre-grasp on: forward, along with the object while the fingers close, and up with it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tr_grasp.dynamic.scene import Scene
from tr_grasp.dynamic.target import Forecast
from tr_grasp.dynamic.tool_path import moved_along_tool
from tr_grasp.motion import IKCfg, inverse_kinematics

Array = NDArray[np.floating]

AFTERWARDS_S = 1.0
"""So long after the grasp, its posture must still be there: the arm goes along while the fingers close."""
JUMP_RAD = 0.9
"""Largest way of a joint from one station to the next."""
_NEAR = IKCfg(rounds_n=0)


@dataclass(frozen=True)
class Station:
    """A place on the way: which share of the approach and of the lift is over, and how long ago the grasp was."""

    forward: float
    since_grasp_s: float = 0.0
    up: float = 0.0


GRASP, CLOSED, LIFTED = Station(1.0), Station(1.0, AFTERWARDS_S), Station(1.0, AFTERWARDS_S, 1.0)
FEW = (GRASP, CLOSED, LIFTED)
"""For a first look at many grasps."""
MANY = (
    *(Station(share) for share in (0.25, 0.5, 0.75)), GRASP, Station(1.0, AFTERWARDS_S / 2), CLOSED,
    *(Station(1.0, AFTERWARDS_S, share) for share in (0.25, 0.5, 0.75)), LIFTED,
)  # fmt: skip
"""Two centimetres apart, or less: a finger does not pass through a board between them."""


@dataclass(frozen=True, eq=False)
class Course:
    """Whether a hand can do all of that, from a posture at the pre-grasp.

    Attributes:
        scene: The arm among obstacles.
        back_off_m: Distance of the pre-grasp from the grasp.
        approach_s: Time from one to the other.
        lift_m: How far up the hand goes with the object.
    """

    scene: Scene
    back_off_m: float
    approach_s: float
    lift_m: float

    def is_free(
        self, forecast: Forecast, T_obj_tcp: Array, q: Array, times_s: Array, stations: tuple[Station, ...]
    ) -> NDArray[np.bool_]:
        """(n,) whether nothing but the object is touched at any station, each near the one before.

        Args:
            forecast: Of the object.
            T_obj_tcp: (n, 4, 4) grasps.
            q: (n, dof) postures at their pre-grasps.
            times_s: (n,) when the hand leaves those.
            stations: Of the way.
        """
        ok, before = np.ones(len(q), bool), q
        for station in stations:
            if not ok.any():
                break
            times = times_s + station.forward * self.approach_s + station.since_grasp_s
            T = moved_along_tool(forecast.poses(times) @ T_obj_tcp, (1 - station.forward) * self.back_off_m)
            T[:, 2, 3] += station.up * self.lift_m
            at = inverse_kinematics(self.scene.kinematics, T, before, _NEAR).q_rad
            near = np.asarray(np.isfinite(at).all(-1))
            near[near] = np.abs(at - before)[near].max(-1) < JUMP_RAD
            ok &= near
            before = np.where(near[:, None], at, before)
            if ok.any():
                ok[ok] = self.scene.grasp.free(before[ok], times[ok])
        return ok
