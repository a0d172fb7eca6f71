"""When to be where on a path: as fast as speed and acceleration limits allow (TOPP-RA)."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from toppra import SplineInterpolator
from toppra.algorithm import TOPPRA
from toppra.constraint import JointAccelerationConstraint, JointVelocityConstraint

from tr_grasp.motion.arguments import Array, joint_rows, joint_vector, positive
from tr_grasp.motion.limits import MotionLimits
from tr_grasp.motion.outcome import Outcome
from tr_grasp.motion.timing import Timing
from tr_grasp.motion.trajectory import Trajectory

SAME_RAD = 1e-9
"""Waypoints closer than this are one."""
GRID_PER_PIECE = 6
"""Points of the computation between two points of the spline: fewer cost speed, since the result then overshoots."""
ATTEMPTS_N = 6
"""How often a limit is lowered by what the result exceeded it, until it is kept everywhere."""
ROOMS = (1.0, 2.0, 4.0)
"""Braking distances (speed² / acceleration) within which the path may turn into or out of a speed that is given."""


def time_optimal(
    waypoints: ArrayLike,
    limits: MotionLimits,
    *,
    start_speed_rad_s: ArrayLike | None = None,
    end_speed_rad_s: ArrayLike | None = None,
    spacing_rad: float = 0.08,
) -> Timing:
    """The fastest trajectory along a path.

    The path is the cubic spline through the waypoints and points between them, which stays close to the straight
    pieces (corners are rounded by less than a tenth of ``spacing_rad``). The result, not the grid on which it was
    computed, is checked against the limits.

    Args:
        waypoints: (n, dof) path [rad]; repeated ones are merged.
        limits: Of the joints; jerk is not limited (follow with :class:`~tr_grasp.motion.servo.Servo` where it must be).
        start_speed_rad_s: (dof,) speed at the start, rest if not given. The path leaves in its direction; where its
            own is another one (up to about 45°) it cuts the corner, over up to four braking distances: check the
            result for collisions again.
        end_speed_rad_s: (dof,) speed at the end, likewise.
        spacing_rad: Largest distance (norm over the joints) between points of the spline.

    Returns:
        ``ALREADY_THERE`` with a resting trajectory for a path of no length; ``PATH_OUTSIDE_LIMITS`` or
        ``INFEASIBLE_SPEED`` without one.

    Raises:
        MotionError: NaN, another number of joints, or a spacing that is not positive.

    Source: Pham & Pham 2018, arXiv:1707.07239.
    """
    rows = joint_rows("waypoints", waypoints, limits.dof)
    positive("spacing_rad", spacing_rad)
    still = np.zeros(limits.dof)
    start = joint_vector("start_speed_rad_s", still if start_speed_rad_s is None else start_speed_rad_s, limits.dof)
    end = joint_vector("end_speed_rad_s", still if end_speed_rad_s is None else end_speed_rad_s, limits.dof)

    if not limits.hold(rows).all():
        return Timing(Outcome.PATH_OUTSIDE_LIMITS, detail=_outside(rows, limits))
    for name, speed in (("start", start), ("end", end)):
        if (np.abs(speed) > limits.velocity_rad_s * (1 + 1e-9)).any():
            return Timing(Outcome.INFEASIBLE_SPEED, detail=f"the {name} speed {speed.tolist()} is above the limits")
    rows = _without_repeats(rows)
    if len(rows) == 1:
        if start.any() or end.any():
            return Timing(Outcome.INFEASIBLE_SPEED, detail="a path of no length has no speed")
        return Timing(Outcome.ALREADY_THERE, Trajectory.resting(rows[0]))
    points = _dense(rows, spacing_rad)
    timing = _time(points, limits, start, end)
    for room in ROOMS if start.any() or end.any() else ():
        if timing.outcome is Outcome.INFEASIBLE_SPEED:
            timing = _time(_with_room(points, room, limits, start, end), limits, start, end)
    return timing


def _with_room(points: Array, room: float, limits: MotionLimits, start: Array, end: Array) -> Array:
    """The path without the points that are nearer to an end than ``room`` braking distances of the speed there."""
    slowest = limits.acceleration_rad_s2.min()
    before, after = (room * (speed @ speed) / slowest for speed in (start, end))
    s = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    inner = (s > before) & (s < s[-1] - after)
    inner[[0, -1]] = True
    return points[inner]


def _time(points: Array, limits: MotionLimits, start: Array, end: Array) -> Timing:
    s = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    ends: Any = _boundary(start), _boundary(end)  # SciPy's boundary conditions; toppra declares text alone
    path = SplineInterpolator(s, points, bc_type=ends)
    pieces = np.linspace(s[:-1], s[1:], GRID_PER_PIECE, endpoint=False, axis=1).ravel()
    grid = np.append(pieces, s[-1])
    # On bends the result overshoots by about a twentieth, so the first attempt is mostly the last.
    directions = np.diff(points, axis=0) / np.diff(s)[:, None]
    bends = np.abs(np.diff(directions, axis=0)).max(initial=0.0) > 1e-6
    shares, found = {"velocity": 0.9995, "acceleration": 0.95 if bends else 0.999}, []
    for _ in range(ATTEMPTS_N):
        trajectory = _solve(path, grid, limits, shares, float(np.linalg.norm(start)), float(np.linalg.norm(end)))
        if trajectory is None:
            break
        # Between waypoints within the position limits a spline may bend past them by a hair.
        found = [v for v in trajectory.violations(limits, margin=0.0) if v.quantity != "position"]
        if not found:
            past = [v for v in trajectory.violations(limits, margin=1e-2) if v.quantity == "position"]
            return Timing(Outcome.PATH_OUTSIDE_LIMITS, detail=str(past[0])) if past else Timing(Outcome.OK, trajectory)
        for name in shares:
            excess = max((v.value / v.limit for v in found if v.quantity == name), default=None)
            shares[name] *= 1.0 if excess is None else 0.999 / excess
    detail = str(found[0]) if found else "the arm can neither brake nor turn in time"
    return Timing(Outcome.INFEASIBLE_SPEED, detail=detail)


def _solve(
    path: SplineInterpolator, grid: Array, limits: MotionLimits, shares: dict[str, float], start: float, end: float
) -> Trajectory | None:
    velocity, acceleration = (
        limits.velocity_rad_s * shares["velocity"],
        limits.acceleration_rad_s2 * shares["acceleration"],
    )
    constraints = [
        JointVelocityConstraint(np.stack([-velocity, velocity], axis=1)),
        JointAccelerationConstraint(np.stack([-acceleration, acceleration], axis=1)),
    ]
    solver = TOPPRA(constraints, path, gridpoints=grid, solver_wrapper="seidel")
    speed = solver.compute_parameterization(start, end)[1]
    if speed is None or not np.isfinite(speed).all():
        return None
    mean = (speed[:-1] + speed[1:]) / 2
    if (mean <= 0).any():
        return None
    times = np.append(0.0, np.cumsum(np.diff(grid) / mean))
    return Trajectory(times, path(grid), path(grid, 1) * speed[:, None])


def _boundary(speed: Array) -> tuple[int, Array]:
    """End condition of the spline: no curvature at rest, the direction of motion otherwise."""
    length = np.linalg.norm(speed)
    return (1, speed / length) if length > 0 else (2, np.zeros_like(speed))


def _without_repeats(rows: Array) -> Array:
    kept = [rows[0]]
    for row in rows[1:]:
        if np.abs(row - kept[-1]).max() > SAME_RAD:
            kept.append(row)
    return np.array(kept)


def _dense(rows: Array, spacing_rad: float) -> Array:
    # A spline through two points bends freely between them when a speed is given.
    fewest = 3 if len(rows) == 2 else 1
    pieces = []
    for a, b in pairwise(rows):
        n = max(fewest, int(np.ceil(np.linalg.norm(b - a) / spacing_rad)))
        pieces.append(a + (b - a) * np.linspace(0.0, 1.0, n, endpoint=False)[:, None])
    return np.vstack([*pieces, rows[-1]])


def _outside(rows: Array, limits: MotionLimits) -> str:
    row, joint = np.argwhere((rows < limits.lower_rad - 1e-6) | (rows > limits.upper_rad + 1e-6))[0]
    return (
        f"joint {joint} is at {rows[row, joint]:.4g} rad in waypoint {row}; "
        f"[{limits.lower_rad[joint]:.4g}, {limits.upper_rad[joint]:.4g}] is allowed"
    )
