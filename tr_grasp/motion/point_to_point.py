"""From one state of motion to another in the least time with limited jerk, joints synchronised (Ruckig)."""

from __future__ import annotations

import numpy as np
import ruckig

from tr_grasp.motion.arguments import Array, joint_vector
from tr_grasp.motion.limits import MotionLimits
from tr_grasp.motion.outcome import Outcome
from tr_grasp.motion.timing import Timing
from tr_grasp.motion.trajectory import JointState, Trajectory

SHORTEST_S = 1e-5
"""Motion that takes less than this is none."""
SHIFT_SHARE = 1e-3
"""Part of an acceleration limit by which merging switches of jerk may exceed it."""


def point_to_point(start: JointState, goal: JointState, limits: MotionLimits, *, at_least_s: float = 0.0) -> Timing:
    """The fastest jerk-limited motion between two states; nothing is checked for collisions.

    Args:
        start: Position, speed and acceleration now; above the limits, the arm first brakes.
        goal: Position and speed to arrive with, for example those of a moving object; acceleration is zero.
        limits: Of the joints.
        at_least_s: So long it takes at least: to arrive at a certain time, if that is not too soon.

    Returns:
        ``GOAL_OUTSIDE_LIMITS``, ``INFEASIBLE_SPEED`` or ``PATH_OUTSIDE_LIMITS`` (it overshoots to turn) without one.

    Raises:
        MotionError: NaN or another number of joints.
    """
    states = [joint_vector(f"start.{name}", getattr(start, name), limits.dof) for name in ("q", "dq", "ddq")]
    aims = [joint_vector(f"goal.{name}", getattr(goal, name), limits.dof) for name in ("q", "dq")]
    if not limits.hold(aims[0]):
        return Timing(Outcome.GOAL_OUTSIDE_LIMITS, detail=f"{aims[0].tolist()}")
    if (np.abs(aims[1]) > limits.velocity_rad_s).any():
        return Timing(Outcome.INFEASIBLE_SPEED, detail=f"the goal's speed {aims[1].tolist()} is above the limits")

    gap_s = _gap(limits)
    request = ruckig_input(limits)
    shift = limits.jerk_rad_s3 * gap_s
    kept = np.where(shift > SHIFT_SHARE * limits.acceleration_rad_s2, shift, 0.0)
    request.max_acceleration = (limits.acceleration_rad_s2 - kept).tolist()
    request.current_position, request.current_velocity, request.current_acceleration = (x.tolist() for x in states)
    if at_least_s > SHORTEST_S:
        request.minimum_duration = at_least_s
    request.target_position, request.target_velocity = (x.tolist() for x in aims)
    # Ruckig Community sends intermediate waypoints to a web service; this package plans between waypoints itself.
    assert not request.intermediate_positions
    answer = ruckig.Trajectory(limits.dof)
    try:
        result = ruckig.Ruckig(limits.dof).calculate(request, answer)
    except ruckig.RuckigError as error:
        return Timing(Outcome.INFEASIBLE_SPEED, detail=str(error).strip())
    if result not in (ruckig.Result.Working, ruckig.Result.Finished):
        return Timing(Outcome.INFEASIBLE_SPEED, detail=str(result))
    if answer.duration < SHORTEST_S:
        return Timing(Outcome.ALREADY_THERE, Trajectory.resting(aims[0]))
    trajectory = _from_ruckig(answer, gap_s)
    # A start outside the limits is where the arm is; leaving them on the way is not.
    if limits.hold(states[0]) and (found := [v for v in trajectory.violations(limits) if v.quantity == "position"]):
        return Timing(Outcome.PATH_OUTSIDE_LIMITS, detail=str(found[0]))
    return Timing(Outcome.OK, trajectory)


def ruckig_input(limits: MotionLimits) -> ruckig.InputParameter:
    """Ruckig's request with these limits, all joints at rest at zero."""
    request = ruckig.InputParameter(limits.dof)
    request.max_velocity = limits.velocity_rad_s.tolist()
    request.max_acceleration = limits.acceleration_rad_s2.tolist()
    request.max_jerk = limits.jerk_rad_s3.tolist()
    return request


def _gap(limits: MotionLimits) -> float:
    """Time under which two switches of jerk are merged into one knot.

    Positions are rounded to about 1e-15 rad, and jerk is a third difference of them: over shorter pieces it would be
    all rounding. Merging shifts acceleration by up to jerk times the gap.
    """
    return float(np.cbrt(2e-12 / limits.jerk_rad_s3.min()))


def _from_ruckig(answer: ruckig.Trajectory, gap_s: float) -> Trajectory:
    """The same motion as cubics: between two switches of jerk of any joint, all joints are cubic."""
    switches = [0.0]
    for profile in answer.profiles[0]:
        brake, rest = profile.brake, profile.accel
        switches += np.cumsum([*brake.t, *profile.t, *rest.t]).tolist()
    times = _apart(np.sort(np.clip(switches, 0.0, answer.duration)), answer.duration, gap_s)
    states = [answer.at_time(t) for t in times]
    return Trajectory(times, np.array([q for q, *_ in states]), np.array([dq for _, dq, _ in states]))


def _apart(times: Array, end: float, gap_s: float) -> Array:
    kept = [0.0]
    for t in times:
        if t - kept[-1] > gap_s and end - t > gap_s:
            kept.append(float(t))
    return np.array([*kept, end])
