"""From the pre-grasp to the grasp."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tr_grasp.dynamic.tool_path import smooth
from tr_grasp.motion import MotionLimits

Array = NDArray[np.floating]

LEVER_M = 0.3
"""Where the hand goes forward by so much, some joint turns by about one radian."""
FORWARD_SHARE = 0.5
"""Part of the limits that going forward takes; the rest is for keeping up with the object."""
PEAK_SPEED, PEAK_ACCELERATION = 15 / 8, 10 / np.sqrt(3)
"""Of :func:`~tr_grasp.dynamic.tool_path.smooth`."""


def approach_time_s(limits: MotionLimits, back_off_m: float) -> float:
    """How long the hand takes from the pre-grasp to the grasp."""
    turn = back_off_m / LEVER_M
    speed, acceleration = (FORWARD_SHARE * x.min() for x in (limits.velocity_rad_s, limits.acceleration_rad_s2))
    return float(max(PEAK_SPEED * turn / speed, np.sqrt(PEAK_ACCELERATION * turn / acceleration)))


@dataclass(frozen=True)
class Approach:
    """When the hand goes forward, in the frame of the object.

    Attributes:
        begins_s: When the hand leaves the pre-grasp.
        takes_s: How long it is on its way.
    """

    begins_s: float
    takes_s: float

    @property
    def ends_s(self) -> float:
        """When it is at the grasp."""
        return self.begins_s + self.takes_s

    def back_m(self, times_s: Array, back_off_m: float) -> Array:
        """How far the hand is still back (n,)."""
        return back_off_m * (1 - smooth((times_s - self.begins_s) / self.takes_s))
