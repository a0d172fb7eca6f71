"""Targets on a circle around the base, and on a sine across a line."""

from __future__ import annotations

import math

from tr_grasp.prediction.motions.lines import linear
from tr_grasp.prediction.motions.state import TargetState, Value, clock, number, positive, stack, state, turn


def circular(
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
    """An arc around the base; the object keeps its heading, as a pad that does not turn.

    Args:
        t: Time [s]; before 0 the target waits at the start, after the end it stands there.
        speed_m_s: Speed on the arc.
        distance_m: Radius; the centre is the base.
        theta_rad: Where on the circle it starts.
        direction: 1 for counter-clockwise, -1 for clockwise.
        yaw_rad: Heading of the object, which does not change.
        z_m: Height.
        length_m: Of the arc.

    Raises:
        PredictionError: A speed, radius or length that is not positive.
    """
    speed, radius = positive("speed_m_s", speed_m_s), positive("distance_m", distance_m)
    time = clock(t, positive("length_m", length_m) / speed)
    angle = number(theta_rad) + number(direction) * speed / radius * time.elapsed_s
    position = turn(stack(radius, 0.0, z_m), angle)
    velocity = turn(stack(0.0, number(direction) * speed, 0.0), angle)
    return state(time, position, velocity, number(yaw_rad))


def sinusoidal(
    t: Value,
    *,
    speed_m_s: Value,
    distance_m: Value,
    theta_rad: Value,
    direction: Value = 1.0,
    yaw_rad: Value = 0.0,
    z_m: Value = 0.02,
    length_m: Value = 1.0,
    amplitude_m: Value = 0.125,
    wavelength_m: Value = 1 / 3,
    phase_rad: Value = 0.0,
) -> TargetState:
    """A sine across the line of :func:`linear`.

    ``speed_m_s`` is the speed along that line, as in the benchmark; on the curve itself the default one is up to 2.56
    times as fast, and 1.88 times on average. The amplitude is radial, and the phase is that in the middle of the line.

    Raises:
        PredictionError: A speed, length or wavelength that is not positive.
    """
    speed, length = positive("speed_m_s", speed_m_s), positive("length_m", length_m)
    time = clock(t, length / speed)
    along = number(direction) * (speed * time.elapsed_s - length / 2)
    wave_number = 2 * math.pi / positive("wavelength_m", wavelength_m)
    phase, rate = wave_number * along + number(phase_rad), number(direction) * speed
    amplitude = number(amplitude_m)
    position = stack(number(distance_m) + amplitude * phase.sin(), along, z_m)
    velocity = stack(amplitude * wave_number * rate * phase.cos(), rate, 0.0)
    return state(time, turn(position, theta_rad), turn(velocity, theta_rad), number(yaw_rad))


def two_tone(
    t: Value,
    *,
    speed_m_s: Value,
    distance_m: Value,
    theta_rad: Value,
    direction: Value = 1.0,
    yaw_rad: Value = 0.0,
    z_m: Value = 0.02,
    length_m: Value = 1.0,
    amplitude_m: Value = 0.08,
    wavelength_m: Value = 0.47,
    phase_rad: Value = 0.0,
    second_amplitude_m: Value = 0.04,
    second_wavelength_m: Value = 0.17,
    second_phase_rad: Value = 1.0,
) -> TargetState:
    """As :func:`sinusoidal`, with a second sine on top, so that no single frequency explains it."""
    placed = {"speed_m_s": speed_m_s, "theta_rad": theta_rad, "direction": direction, "length_m": length_m}
    first = sinusoidal(
        t,
        distance_m=distance_m,
        yaw_rad=yaw_rad,
        z_m=z_m,
        amplitude_m=amplitude_m,
        wavelength_m=wavelength_m,
        phase_rad=phase_rad,
        **placed,
    )
    second = sinusoidal(
        t,
        distance_m=0.0,
        z_m=0.0,
        amplitude_m=second_amplitude_m,
        wavelength_m=second_wavelength_m,
        phase_rad=second_phase_rad,
        **placed,
    )
    line = linear(t, distance_m=0.0, z_m=0.0, **placed)
    return first._replace(
        position=first.position + second.position - line.position,
        velocity=first.velocity + second.velocity - line.velocity,
    )
