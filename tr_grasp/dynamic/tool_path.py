"""Joint trajectories along which the tool follows a pose that moves, entered smoothly from whatever the arm does."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from tr_grasp.motion import IKCfg, JointState, Kinematics, MotionLimits, Trajectory, inverse_kinematics

Array = NDArray[np.floating]
ToolPoses = Callable[[Array], Array]
"""``T_base_tcp`` (n, 4, 4) at times (n,) of the world's clock."""

SPACING_S = 0.05
JUMP_RAD = 0.35
"""A joint that moves further than this from one knot to the next would have to take another posture."""
BLENDS_S = (0.1, 0.2, 0.4, 0.8, 1.6)
SMALLEST_RAD, SMALLEST_RAD_S = 1e-3, 1e-2
_NEAR = IKCfg(rounds_n=0)


def follow(
    kinematics: Kinematics,
    limits: MotionLimits,
    tool_poses: ToolPoses,
    start: JointState,
    start_s: float,
    duration_s: float,
    near_q: Array | None = None,
    blends_s: Sequence[float] = BLENDS_S,
) -> Trajectory | None:
    """The trajectory that brings the tool onto a moving pose and keeps it there.

    Args:
        kinematics: The arm.
        limits: Of its joints.
        tool_poses: Where the tool should be when.
        start: What the arm is commanded to do at the start.
        start_s: When that is.
        duration_s: How far ahead.
        near_q: (dof,) posture to stay in; that of the start, if not given.
        blends_s: Times within which what the arm is off may vanish, ascending; the first that the limits allow is
            taken.

    Returns:
        Nothing where the tool gets out of reach, would need another posture, or has to move faster than the limits.
    """
    n = max(3, round(duration_s / SPACING_S) + 1)
    tau = np.linspace(0.0, duration_s, n)
    q = postures_along(kinematics, tool_poses(start_s + tau), start.q if near_q is None else near_q)
    if q is None:
        return None
    path = Trajectory(tau, q, np.gradient(q, tau, axis=0, edge_order=2))
    off, off_speed = start.q - q[0], start.dq - path.dq_rad_s[0]
    on_track = np.abs(off).max() < SMALLEST_RAD and np.abs(off_speed).max() < SMALLEST_RAD_S
    return entered(path, start, limits, BLENDS_S[1:] if on_track else blends_s)


def entered(
    path: Trajectory, start: JointState, limits: MotionLimits, blends_s: Sequence[float] = BLENDS_S
) -> Trajectory | None:
    """A trajectory, but from another state on: what that is off vanishes as a cubic, as quickly as the limits allow.

    Returns:
        Nothing where the limits allow none of the times, or all are longer than the trajectory.
    """
    off, off_speed = start.q - path.q_rad[0], start.dq - path.dq_rad_s[0]
    for blend_s in blends_s:
        if blend_s > path.duration_s:
            break
        joined = _blended(path, off, off_speed, blend_s)
        if not joined.violations(limits):
            return joined
    return None


def postures_along(kinematics: Kinematics, T_base_tcp: Array, near_q: Array) -> Array | None:
    """(n, dof) joints at poses (n, 4, 4) in a row, each near the one before; nothing where there are none."""
    rows = inverse_kinematics(kinematics, T_base_tcp, near_q, _NEAR).postures_rad
    q = np.empty((len(rows), rows.shape[-1]))
    last = near_q
    for i, postures in enumerate(rows):
        gaps = np.nan_to_num(np.abs(postures - last).max(-1), nan=np.inf)
        k = int(np.argmin(gaps))
        if not np.isfinite(gaps[k]) or (i and gaps[k] > JUMP_RAD):
            return None
        last = q[i] = postures[k]
    return q


def smooth(share: Array | float) -> Array:
    """From 0 to 1 at rest, without a jump of acceleration (quintic); constant outside."""
    s = np.clip(share, 0.0, 1.0)
    return np.asarray(s**3 * (10 - 15 * s + 6 * s**2))


def moved_along_tool(T_base_tcp: Array, back_m: Array | float) -> Array:
    """Poses (n, 4, 4) drawn back against their own z axis by (n,) or one length."""
    T = np.array(T_base_tcp, float)
    T[..., :3, 3] -= np.asarray(back_m)[..., None] * T[..., :3, 2]
    return T


def shortest_allowed(build: Callable[[float], Trajectory | None], durations_s: Sequence[float]) -> Trajectory | None:
    """The first trajectory that exists when built for one duration after the other."""
    return next((path for duration in durations_s if (path := build(duration)) is not None), None)


def _blended(path: Trajectory, off: Array, off_speed: Array, blend_s: float) -> Trajectory:
    """The path plus an error that vanishes as a cubic within a time, to rest."""
    knots = np.union1d(np.round(path.times_s, 9), [round(blend_s, 9)])
    base = path.sample(np.minimum(knots, path.duration_s))
    u = np.clip(knots / blend_s, 0.0, 1.0)[:, None]
    w = blend_s * off_speed
    error = off + u * (w + u * ((-3 * off - 2 * w) + u * (2 * off + w)))
    speed = (w + u * (2 * (-3 * off - 2 * w) + 3 * u * (2 * off + w))) / blend_s
    return Trajectory(knots, base.q + error, base.dq + speed)
