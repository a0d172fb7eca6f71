"""Timing: ``python -m benchmarks.timing``.

Prints JSON rows: time-optimal trajectories beside plain TOPP-RA with its own grid, jerk-limited motion between states,
how often limits are exceeded in random trajectories, and how far a servo stays behind a moving target.
"""

from __future__ import annotations

import argparse
from itertools import product

import numpy as np
import toppra
from toppra.algorithm import TOPPRA
from toppra.constraint import JointAccelerationConstraint, JointVelocityConstraint

from benchmarks._arms import Array, kinematics, postures, tool_down
from benchmarks._common import median_ms, now_s, print_row
from tr_grasp.motion import JointState, MotionLimits, Servo, Timing, point_to_point, time_optimal, tool_target
from tr_grasp.motion.limits import SHARE

ARMS = ("panda", "ur5_rg2", "j2s7s300")
PERIOD_S = 1 / 240


def plain_toppra(waypoints: Array, limits: MotionLimits):
    """The library as its tutorial uses it: a spline through the waypoints and a grid of its own choice."""
    s = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(waypoints, axis=0), axis=1)))
    v, a = limits.velocity_rad_s, limits.acceleration_rad_s2
    constraints = [JointVelocityConstraint(np.stack([-v, v], 1)), JointAccelerationConstraint(np.stack([-a, a], 1))]
    return TOPPRA(constraints, toppra.SplineInterpolator(s, waypoints)).compute_trajectory()


def walk(rng: np.random.Generator, n: int, arm_name: str) -> Array:
    """Waypoints (n, dof) of a random walk within the limits."""
    arm = kinematics(arm_name)
    steps = np.vstack([postures(arm, 1, rng), rng.normal(0.0, 0.25, (n - 1, arm.dof))])
    return np.clip(np.cumsum(steps, axis=0), arm.lower_rad, arm.upper_rad)


def toppra_rows(repeats: int) -> None:
    """Time and largest use of the acceleration limit, by the number of waypoints."""
    limits = MotionLimits.of(kinematics("panda").spec)
    for n in (2, 5, 10, 20):
        waypoints = walk(np.random.default_rng(n), n, "panda")
        ours, theirs = median_ms(
            lambda w=waypoints: time_optimal(w, limits), lambda w=waypoints: plain_toppra(w, limits), repeats=repeats
        )
        trajectory, peer = time_optimal(waypoints, limits).trajectory, plain_toppra(waypoints, limits)
        assert trajectory is not None
        fine = peer(np.linspace(0.0, peer.duration, 5000), 2)
        print_row(
            f"time_optimal, {n} waypoints",
            ours,
            "plain toppra, spline through the waypoints alone",
            theirs,
            duration_s=round(trajectory.duration_s, 3),
            acceleration_share=round(float((trajectory.peaks()["acceleration"] / limits.acceleration_rad_s2).max()), 4),
            peer_duration_s=round(float(peer.duration), 3),
            peer_acceleration_share=round(float((np.abs(fine) / limits.acceleration_rad_s2).max()), 4),
        )


def used(timing: Timing, limits: MotionLimits, samples_n: int = 2000) -> tuple[float, float, float]:
    """Largest shares of speed, acceleration and jerk limits over samples, knots and the exact extremes."""
    trajectory = timing.trajectory
    assert trajectory is not None
    state = trajectory.sample(np.linspace(0.0, trajectory.duration_s, samples_n))
    peaks = trajectory.peaks()
    speed = np.maximum(peaks["velocity"], np.abs(state.dq).max(0)) / limits.velocity_rad_s
    acceleration = np.maximum(peaks["acceleration"], np.abs(state.ddq).max(0)) / limits.acceleration_rad_s2
    return float(speed.max()), float(acceleration.max()), float((peaks["jerk"] / limits.jerk_rad_s3).max())


def random_rows(trajectories_n: int) -> None:
    """Random trajectories of both kinds, all arms, both sets of limits; how many exceed one by more than the margin."""
    rng = np.random.default_rng(0)
    kinds = list(product(ARMS, SHARE))
    for kind, margin in (("time_optimal", 0.0), ("point_to_point", 5e-3)):
        shares, refused, spent = [], 0, []
        for i in range(trajectories_n):
            name, which = kinds[i % len(kinds)]
            limits = MotionLimits.of(kinematics(name).spec, which)
            if kind == "time_optimal":
                waypoints = walk(rng, int(rng.integers(2, 9)), name)
                begun = now_s()
                timing = time_optimal(waypoints, limits)
            else:
                ends = [
                    JointState(q, rng.uniform(-0.9, 0.9, limits.dof) * limits.velocity_rad_s, np.zeros(limits.dof))
                    for q in postures(kinematics(name), 2, rng)
                ]
                begun = now_s()
                timing = point_to_point(*ends, limits)
            spent.append((now_s() - begun) * 1e3)
            if timing.trajectory is None:
                refused += 1
            else:
                shares.append(used(timing, limits))
        worst = np.array(shares)
        jerk_limited = kind == "point_to_point"
        checked = worst if jerk_limited else worst[:, :2]
        print_row(
            f"{kind}, random trajectories",
            float(np.median(spent)),
            trajectories=len(shares),
            refused=refused,
            violations=int((checked > 1 + margin).any(1).sum()),
            margin=margin,
            largest_speed_share=round(float(worst[:, 0].max()), 6),
            largest_acceleration_share=round(float(worst[:, 1].max()), 6),
            largest_jerk_share=round(float(worst[:, 2].max()), 6) if jerk_limited else None,
        )


def target_at(t: float, speed: float, shape: str) -> Array:
    """``T_base_tcp`` of a target on a line across the workspace, or on a circle of 15 cm radius."""
    if shape == "line":
        return tool_down(0.5, -0.25 + speed * t, 0.3)
    return tool_down(0.5 - 0.15 * np.cos(speed * t / 0.15), 0.15 * np.sin(speed * t / 0.15), 0.3)


def servo_row(name: str, which: str, speed: float, shape: str, predictor_hz: float) -> None:
    """The arm starts 10 cm above; the target is seen at a fixed rate and taken to move on at its last velocity."""
    arm = kinematics(name)
    limits = MotionLimits.of(arm.spec, which)
    servo = Servo(limits, PERIOD_S)
    start = target_at(0.0, speed, shape)
    start[2, 3] += 0.1
    near = tool_target(arm, start, np.zeros(6), arm.home_q_rad)
    assert near is not None
    q_target = servo.start(near.q).q
    seen_s = 1 / predictor_hz
    errors, spent = [], []
    duration_s = min(10.0, 0.5 / speed) if shape == "line" else 10.0
    for tick in range(int(duration_s / PERIOD_S)):
        now = tick * PERIOD_S
        last = np.floor(now / seen_s) * seen_s
        seen, before = target_at(last, speed, shape), target_at(last - seen_s, speed, shape)
        velocity = np.append((seen - before)[:3, 3] / seen_s, np.zeros(3))
        predicted = seen.copy()
        predicted[:3, 3] += velocity[:3] * (now - last)
        begun = now_s()
        # Out of reach, it waits where the target was last.
        aim = tool_target(arm, predicted, velocity, q_target) or JointState.at_rest(q_target)
        q_target = aim.q
        state = servo.track(aim.q, aim.dq)
        spent.append((now_s() - begun) * 1e3)
        errors.append(np.linalg.norm(arm.pose(state.q)[:3, 3] - target_at(now + PERIOD_S, speed, shape)[:3, 3]) * 1e3)
    late = np.array(errors[len(errors) // 2 :])
    inside = np.array(errors) < 5.0
    settled = next((i for i in range(len(inside)) if inside[i:].all()), None)
    print_row(
        f"servo, {name}, {which} limits, {shape} at {100 * speed:g} cm/s, seen at {predictor_hz:g} Hz",
        float(np.median(spent)),
        mean_error_mm=round(float(late.mean()), 3),
        largest_error_mm=round(float(late.max()), 3),
        within_5_mm_after_s=None if settled is None else round((settled + 1) * PERIOD_S, 2),
    )


def main(args: list[str] | None = None) -> None:
    """Print all rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trajectories", type=int, default=1000, help="random ones, of each kind")
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument("--predictor-hz", type=float, default=10.0)
    parser.add_argument("--random-only", action="store_true", help="only the rows of random trajectories")
    given = parser.parse_args(args)
    if not given.random_only:
        toppra_rows(given.repeats)
    random_rows(given.trajectories)
    if given.random_only:
        return
    # A tenth of the Kinova's speed, 0.06 rad/s, follows nothing.
    arms = [("ur5_rg2", "rated"), ("ur5_rg2", "thesis"), ("j2s7s300", "rated"), ("panda", "rated")]
    for (name, which), speed, shape in product(arms, (0.05, 0.10, 0.20), ("line", "circle")):
        servo_row(name, which, speed, shape, given.predictor_hz)


if __name__ == "__main__":
    main()
