"""The last measurements of a target, at the even spacing that networks want."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Window:
    """Remembers measurements and gives them back at even times, with straight lines in between.

    Before the first measurement the target is taken to have stood where that found it.

    Args:
        span_s: How long measurements are kept.
    """

    def __init__(self, span_s: float) -> None:
        self.span_s = span_s
        self._times: deque[float] = deque()
        self._positions: deque[Array] = deque()

    def clear(self) -> None:
        """Forget everything."""
        self._times.clear()
        self._positions.clear()

    def add(self, t: float, position: Array) -> None:
        """Remember a position (3,) at ``t`` [s], later than all before."""
        self._times.append(t)
        self._positions.append(position)
        # One that is older than the span stays, so that the line across the border is known.
        while len(self._times) > 2 and self._times[1] < t - self.span_s:
            self._times.popleft()
            self._positions.popleft()

    def at(self, times: Array) -> Array:
        """Positions (n, 3) at times (n,) up to the newest."""
        positions = np.array(self._positions)
        return np.stack([np.interp(times, self._times, axis) for axis in positions.T], -1)


def even_times(newest_s: float, n: int, period_s: float) -> Array:
    """(n,) Times ``period_s`` apart, oldest first, the last at ``newest_s``."""
    return np.asarray(newest_s - period_s * np.arange(n - 1, -1, -1), np.float64)
