"""A world that is only a clock and things on rails: time passes when somebody waits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from tr_grasp.errors import MotionError, unknown_name
from tr_grasp.hardware.pose_stream import PoseStream, PoseStreamCfg
from tr_grasp.hardware.readings import PoseReading
from tr_grasp.motion.arguments import Array

TICK_S = 0.005


@dataclass(frozen=True, eq=False)
class ScriptedObject:
    """A thing that moves on its own.

    Attributes:
        name: Of its poses.
        motion: ``T_base_object`` (n, 4, 4) at times (n,) [s]; nothing while it cannot be seen.
        stream: How it is tracked.
    """

    name: str
    motion: Callable[[Array], Array | None]
    stream: PoseStreamCfg = field(default_factory=PoseStreamCfg)


class VirtualWorld:
    """A clock that goes on in ticks, and the things in it.

    Args:
        objects: Their names are unique.
        tick_s: Time between two ticks. What is waited for adds up: many short waits are as long as one.
    """

    def __init__(self, objects: Sequence[ScriptedObject] = (), tick_s: float = TICK_S) -> None:
        self.tick_s, self._ticks, self._owed_s = tick_s, 0, 0.0
        self._objects = {thing.name: (thing, PoseStream(thing.stream)) for thing in objects}
        self._listeners: list[Callable[[float], None]] = []
        self._observe()

    def on_tick(self, listener: Callable[[float], None]) -> None:
        """Call a function with the length of the tick after each one."""
        self._listeners.append(listener)

    @property
    def now_s(self) -> float:
        """The clock."""
        return self._ticks * self.tick_s

    def wait(self, duration_s: float) -> None:
        """Tick as often as the time that has been waited for holds."""
        self._owed_s += checked_duration(duration_s)
        while self._owed_s > self.tick_s * (1 - 1e-6):
            self._owed_s -= self.tick_s
            self._ticks += 1
            self._observe()
            for listener in self._listeners:
                listener(self.tick_s)

    def charge(self, duration_s: float) -> None:
        """As :meth:`wait`: nothing else makes virtual time pass."""
        self.wait(duration_s)

    @property
    def objects(self) -> tuple[str, ...]:
        """Names of the things."""
        return tuple(self._objects)

    def poses(self, name: str, after_s: float = float("-inf")) -> tuple[PoseReading, ...]:
        """Readings that have arrived."""
        if name not in self._objects:
            raise MotionError(unknown_name("object", name, self._objects))
        return self._objects[name][1].arrived(self.now_s, after_s)

    def _observe(self) -> None:
        for thing, stream in self._objects.values():
            T = thing.motion(np.array([self.now_s]))
            if T is not None:
                stream.observe(self.now_s, np.asarray(T)[0])


def checked_duration(duration_s: float) -> float:
    """A duration that may be waited for.

    Raises:
        MotionError: It is negative or not finite.
    """
    if not (np.isfinite(duration_s) and duration_s >= 0):
        raise MotionError(f"duration_s must be zero or more, got {duration_s}.")
    return float(duration_s)
