"""What thinking costs: the time that it took, or the fixed charges of the benchmark."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

from tr_grasp.configs.dynamic import ChargesCfg, Work
from tr_grasp.hardware import World
from tr_grasp.hardware.waiting import Thought


@contextmanager
def charged(world: World, cfg: ChargesCfg, work: Work, calls_n: int = 1) -> Iterator[Thought]:
    """Let the world go on for as long as the block inside costs.

    The world stands still inside. An error inside costs nothing.

    Args:
        world: Its clock pays.
        cfg: How the cost is found.
        work: What is done, for the fixed charges.
        calls_n: How many inverse-kinematics calls, if that is the work; each is charged.

    Yields:
        Its ``seconds`` are known after the block.
    """
    thought, clock = Thought(), time.thread_time if cfg.clock == "cpu" else time.perf_counter
    begun = clock()
    yield thought
    thought.seconds = cfg.cost_s(work, clock() - begun, calls_n)
    world.charge(thought.seconds)
