"""What goes wrong with a fake station, and when."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

FaultName = Literal["disconnected", "stale", "emergency_stop"]


@dataclass(frozen=True)
class Fault:
    """Something that goes wrong for a while: no connection; states that no longer change; the red button."""

    name: FaultName
    from_s: float
    until_s: float = float("inf")


class FaultScript:
    """Which faults hold now."""

    def __init__(self, faults: Sequence[Fault], clock: Callable[[], float]) -> None:
        self._faults, self._clock = tuple(faults), clock

    def holds(self, name: FaultName) -> Fault | None:
        """The fault of this name that holds now."""
        now = self._clock()
        return next((f for f in self._faults if f.name == name and f.from_s <= now < f.until_s), None)

    @property
    def stamp_s(self) -> float:
        """Stamp of states read now: old while they are stale."""
        stale = self.holds("stale")
        return self._clock() if stale is None else stale.from_s

    @property
    def reason(self) -> str:
        """Why nothing can move now; empty if it can."""
        if self.holds("disconnected"):
            return "no connection"
        return "emergency stop" if self.holds("emergency_stop") else ""
