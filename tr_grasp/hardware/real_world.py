"""The real world: its time passes by itself, and whoever waits sleeps."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from math import ceil
from typing import Protocol

from tr_grasp.errors import MotionError, unknown_name
from tr_grasp.hardware.readings import PoseReading
from tr_grasp.hardware.virtual_world import checked_duration
from tr_grasp.motion.arguments import positive

KEPT_N = 2000
"""Readings of each tracked thing that are kept."""
ROUNDING_S = 1e-9


class Beats(Protocol):
    """A clock that calls back at a rate: what device adapters run on."""

    @property
    def now_s(self) -> float:
        """The clock."""
        ...

    def every(self, period_s: float, beat: Callable[[], None]) -> Callable[[], None]:
        """Call a function every period until the function that is returned is called."""
        ...


class RealWorld:
    """A monotonic clock that starts at zero.

    What a sleep takes too long the next :meth:`wait` takes less, so that many short waits are as long as one; time that
    the caller spends between two waits is never taken off.

    Args:
        tracked: Names of things whose poses somebody reports.
        clock: Seconds, from anywhere on.
        sleep: Lets seconds pass.
    """

    def __init__(
        self,
        tracked: Sequence[str] = (),
        clock: Callable[[], float] = time.perf_counter,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._clock, self._sleep = clock, sleep
        self._begun, self._overslept_s = clock(), 0.0
        self._tracked: dict[str, deque[PoseReading]] = {name: deque(maxlen=KEPT_N) for name in tracked}
        self._endings: list[Callable[[], None]] = []

    @property
    def now_s(self) -> float:
        """Seconds since it was made."""
        return self._clock() - self._begun

    def wait(self, duration_s: float) -> None:
        """Sleep until the duration is over."""
        until = self.now_s + checked_duration(duration_s) - self._overslept_s
        while (left := until - self.now_s) > ROUNDING_S:
            self._sleep(left)
        self._overslept_s = self.now_s - until

    def charge(self, duration_s: float) -> None:
        """Nothing: thinking has taken its time already."""
        checked_duration(duration_s)

    @property
    def objects(self) -> tuple[str, ...]:
        """Names of what is tracked."""
        return tuple(self._tracked)

    def poses(self, name: str, after_s: float = float("-inf")) -> tuple[PoseReading, ...]:
        """Readings that have been reported."""
        return tuple(reading for reading in self._of(name) if reading.stamp_s > after_s)

    def report(self, name: str, reading: PoseReading) -> None:
        """Tell where a tracked thing was seen; readings come in order of their stamps.

        Raises:
            MotionError: Nothing of that name is tracked.
        """
        self._of(name).append(reading)

    def every(self, period_s: float, beat: Callable[[], None]) -> Callable[[], None]:
        """Call a function in a thread of its own at multiples of the period, counted from now.

        Beats do not drift, and one that would be late by a whole period is left out: a device that buffers commands
        must never get a burst of them.
        """
        positive("period_s", period_s)
        over = threading.Event()

        def run() -> None:
            begun, number = self.now_s, 0
            while not over.is_set():
                beat()
                number = max(number + 1, ceil((self.now_s - begun - ROUNDING_S) / period_s))
                if (left := begun + number * period_s - self.now_s) > ROUNDING_S:
                    self._sleep(left)

        thread = threading.Thread(target=run, name="tr_grasp beats", daemon=True)
        thread.start()

        def end() -> None:
            over.set()
            if thread is not threading.current_thread():
                thread.join(timeout=1.0)

        return end

    def at_close(self, ending: Callable[[], None]) -> None:
        """Call a function when the world is closed, the last one first."""
        self._endings.append(ending)

    def close(self) -> None:
        """Stop and let go of every device in it; again and again, if you like."""
        while self._endings:
            self._endings.pop()()

    def __enter__(self) -> RealWorld:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _of(self, name: str) -> deque[PoseReading]:
        if name not in self._tracked:
            raise MotionError(unknown_name("object", name, self._tracked))
        return self._tracked[name]
