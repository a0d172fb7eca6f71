"""Waiting for a command, and paying for the time that thinking takes."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from tr_grasp.hardware.command import Command, Result
from tr_grasp.hardware.protocols import World
from tr_grasp.motion.arguments import positive


def finish(command: Command, world: World, *, limit_s: float = 60.0, every_s: float = 0.01) -> Result:
    """Let time pass until a command has ended; it is cancelled after ``limit_s``, and given as long to come to rest.

    Raises:
        MotionError: A time that is not positive.
    """
    positive("limit_s", limit_s)
    positive("every_s", every_s)
    for _ in range(2):
        until = world.now_s + limit_s
        while not command.done and world.now_s < until:
            world.wait(every_s)
        command.cancel()
        if command.result is not None:
            return command.result
    raise TimeoutError(f"a cancelled command did not end within {limit_s:g} s.")


@dataclass
class Thought:
    """How long a block of :func:`thinking` took [s]; known after it."""

    seconds: float = 0.0


@contextmanager
def thinking(world: World, fixed_s: float | None = None) -> Iterator[Thought]:
    """Whatever is computed inside costs the world as much time as it took, or ``fixed_s``.

    In a simulation the world stands still inside and moves on at the end; a real one moves on by itself. To start a
    motion on time, plan from ``arm.commanded(t)`` for a ``t`` that is far enough ahead, and send it with ``at_s=t``.
    """
    thought, begun = Thought(), time.perf_counter()
    yield thought
    thought.seconds = time.perf_counter() - begun if fixed_s is None else fixed_s
    world.charge(thought.seconds)
