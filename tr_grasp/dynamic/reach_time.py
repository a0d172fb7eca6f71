"""The least time in which joints get from one motion to another, in closed form."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tr_grasp.motion import JointState, MotionLimits

Array = NDArray[np.floating]


def least_time(start: JointState, q: Array, dq: Array, limits: MotionLimits) -> Array:
    """Time to reach joints with speeds, each joint on its own, limited in speed and acceleration but not in jerk.

    A lower bound of every motion within the limits: trapezoids of speed, the slowest joint counts.

    Args:
        start: (dof,) position and speed now.
        q: (*batch, dof) position to arrive at; NaN where there is none.
        dq: (*batch, dof) speed to arrive with.
        limits: Of the joints.

    Returns:
        (*batch,) [s]; infinite where q is NaN.
    """
    top, a = limits.velocity_rad_s, limits.acceleration_rad_s2
    v0, v1 = np.clip(start.dq, -top, top), np.clip(dq, -top, top)
    way = q - start.q
    # Changing speed as directly as possible leads this far; what is left decides the direction of the detour.
    direct = (v0 + v1) / 2 * np.abs(v1 - v0) / a
    sign = np.where(way >= direct, 1.0, -1.0)
    way, u0, u1 = sign * way, sign * v0, sign * v1
    peak = np.sqrt(np.maximum(a * way + (u0**2 + u1**2) / 2, 0.0))
    peak = np.clip(peak, np.maximum(u0, u1), top)
    ramps = (2 * peak - u0 - u1) / a
    covered = (2 * peak**2 - u0**2 - u1**2) / (2 * a)
    cruise = np.maximum(way - covered, 0.0) / top
    return np.nan_to_num((ramps + cruise).max(-1), nan=np.inf)


def turning_time(angle_rad: float, limits: MotionLimits) -> float:
    """Time that every joint needs to turn by an angle from rest to rest [s]."""
    still = np.zeros(limits.dof)
    return float(least_time(JointState.at_rest(still), np.full(limits.dof, angle_rad), still, limits))
