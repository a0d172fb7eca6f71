"""From the pre-grasp to the grasp."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tr_grasp.dynamic.tool_path import smooth

Array = NDArray[np.floating]


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
