"""Targets that ride straight lines: level, climbing, slowing down, turning about themselves.

A line is tangential to a circle around the robot's base: its middle is at distance ``distance_m`` and angle
``theta_rad``, and it is perpendicular to the radius there.
"""

from __future__ import annotations

import torch

from tr_grasp.prediction.motions.state import TargetState, Value, clock, number, positive, stack, state, turn

SEGMENTS_N = 10
SLOWEST = 0.6


def linear(
    t: Value,
    *,
    speed_m_s: Value,
    distance_m: Value,
    theta_rad: Value,
    direction: Value = 1.0,
    yaw_rad: Value = 0.0,
    z_m: Value = 0.02,
    length_m: Value = 1.0,
) -> TargetState:
    """A level line at constant speed.

    Args:
        t: Time [s]; before 0 the target waits at the start, after the end it stands there.
        speed_m_s: Speed on the path.
        distance_m: From the base to the middle of the line.
        theta_rad: Direction of that middle, seen from the base.
        direction: 1 for counter-clockwise around the base, -1 for the other way.
        yaw_rad: Heading of the object, which does not change.
        z_m: Height.
        length_m: Of the line.

    Raises:
        PredictionError: A speed or length that is not positive.
    """
    return linear_z(
        t,
        speed_m_s=speed_m_s,
        distance_m=distance_m,
        theta_rad=theta_rad,
        direction=direction,
        yaw_rad=yaw_rad,
        z_start_m=z_m,
        z_end_m=z_m,
        length_m=length_m,
    )


def linear_z(
    t: Value,
    *,
    speed_m_s: Value,
    distance_m: Value,
    theta_rad: Value,
    direction: Value = 1.0,
    yaw_rad: Value = 0.0,
    z_start_m: Value,
    z_end_m: Value,
    length_m: Value = 1.0,
) -> TargetState:
    """As :func:`linear`, on a slope; ``length_m`` is that of its plan, the speed that in space."""
    speed, length = positive("speed_m_s", speed_m_s), positive("length_m", length_m)
    climb = number(z_end_m) - number(z_start_m)
    duration = torch.sqrt(length**2 + climb**2) / speed
    time = clock(t, duration)
    share, rate = time.elapsed_s / duration, 1 / duration
    position = stack(distance_m, number(direction) * length * (share - 0.5), number(z_start_m) + climb * share)
    velocity = stack(0.0, number(direction) * length * rate, climb * rate)
    return state(time, turn(position, theta_rad), turn(velocity, theta_rad), number(yaw_rad))


def rotating(
    t: Value,
    *,
    speed_m_s: Value,
    distance_m: Value,
    theta_rad: Value,
    yaw_rate_rad_s: Value,
    direction: Value = 1.0,
    yaw_rad: Value = 0.0,
    z_m: Value = 0.02,
    length_m: Value = 1.0,
) -> TargetState:
    """As :func:`linear`, while the object turns about the vertical at ``yaw_rate_rad_s``, from ``yaw_rad`` on."""
    line = linear(
        t,
        speed_m_s=speed_m_s,
        distance_m=distance_m,
        theta_rad=theta_rad,
        direction=direction,
        z_m=z_m,
        length_m=length_m,
    )
    time = clock(t, number(length_m) / number(speed_m_s))
    yaw = number(yaw_rad) + number(yaw_rate_rad_s) * time.elapsed_s
    return state(time, line.position, line.velocity, yaw, yaw_rate_rad_s)


def varying_speed(
    t: Value,
    *,
    speed_m_s: Value,
    distance_m: Value,
    theta_rad: Value,
    direction: Value = 1.0,
    yaw_rad: Value = 0.0,
    z_m: Value = 0.02,
    length_m: Value = 1.0,
) -> TargetState:
    """As :func:`linear`, in ten equal segments: ``speed_m_s`` on the first, falling evenly to 60 % on the last."""
    speed, length = positive("speed_m_s", speed_m_s), positive("length_m", length_m)
    factors = torch.linspace(1.0, SLOWEST, SEGMENTS_N, dtype=torch.float64)
    speed, length = torch.broadcast_tensors(speed, length)
    durations = (length / SEGMENTS_N / speed).unsqueeze(-1) / factors
    time = clock(t, durations.sum(-1))
    ends = durations.cumsum(-1)
    started = time.elapsed_s.unsqueeze(-1) - (ends - durations)
    # Every segment adds the way that was made on it: none, part, or all.
    travelled = (torch.minimum(started.clamp(min=0.0), durations) * factors).sum(-1) * speed
    current = (time.elapsed_s.unsqueeze(-1) >= ends).sum(-1).clamp(max=SEGMENTS_N - 1)
    position = stack(distance_m, number(direction) * (travelled - length / 2), z_m)
    velocity = stack(0.0, number(direction) * speed * factors[current], 0.0)
    return state(time, turn(position, theta_rad), turn(velocity, theta_rad), number(yaw_rad))
