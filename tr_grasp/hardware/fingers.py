"""What all grippers check before they move."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tr_grasp.errors import MotionError
from tr_grasp.robots.parts import GripperSpec

EDGE = 1e-6


class FingerGoal(NamedTuple):
    """Where the fingers go, how fast and with what force."""

    opening_m: float
    speed_mps: float
    force_n: float


def finger_goal(
    gripper: GripperSpec, opening_m: float, speed_mps: float | None, force_n: float | None
) -> FingerGoal | str:
    """The goal with the gripper's usual values filled in, or why it is refused.

    Raises:
        MotionError: NaN.
    """
    low, high = gripper.speed_range_mps
    speed = float(np.clip(gripper.speed_mps, low, high)) if speed_mps is None else float(speed_mps)
    force = gripper.force_n if force_n is None else float(force_n)
    goal = FingerGoal(float(opening_m), speed, force)
    ranges = (gripper.opening_range_m, gripper.speed_range_mps, gripper.force_range_n)
    for name, value, (least, most) in zip(goal._fields, goal, ranges, strict=True):
        if np.isnan(value):
            raise MotionError(f"{name} must be a number, got NaN.")
        if not least - EDGE <= value <= most + EDGE:
            return f"{name} must be from {least:g} to {most:g}, got {value:g}"
    return goal
