"""Stamps of a device's clock as times of ours."""

from __future__ import annotations

DRIFT = 1e-4
"""Part by which two clocks may run apart."""


class RemoteClock:
    """Learns how far a device's clock is ahead from when its messages arrive.

    The message that was fastest on its way tells most, so the smallest difference seen is the offset; it may grow as
    fast as clocks drift. Stamps come out late by the fastest transport, never in the future.
    """

    def __init__(self) -> None:
        self._offset_s: float | None = None
        self._arrival_s = 0.0

    def local_s(self, stamp_s: float, arrival_s: float) -> float:
        """A stamp of the device as a time of our clock; ``arrival_s`` is when its message came."""
        offset = arrival_s - stamp_s
        if self._offset_s is not None:
            offset = min(offset, self._offset_s + DRIFT * max(0.0, arrival_s - self._arrival_s))
        self._offset_s, self._arrival_s = offset, arrival_s
        return min(stamp_s + offset, arrival_s)  # rounding must not bring it into the future
