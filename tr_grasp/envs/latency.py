"""Commands that take effect late."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from tr_grasp.robots.agents import CartesianController, CartesianControllerConfig


class LateController(CartesianController):
    """A controller that begins each move some physics steps after it was told to, and ends it as much later.

    Until then it goes on with the move before. The delay is at most a policy step, so one command waits at a time.
    """

    delay_substeps = 0
    """Physics steps between a command and its effect."""

    def reset(self) -> None:
        """As the controller without delay; a command that still waits is forgotten."""
        super().reset()
        self._waiting: ArrayLike | None = None

    def set_action(self, action: ArrayLike) -> None:
        """Take a command (1, 5) or (5,), for later."""
        if self._waiting is not None:  # the delay is a whole policy step
            super().set_action(self._waiting)
        self._waiting, self._substeps_to_go = action, self.delay_substeps

    def before_simulation_step(self) -> None:
        """Begin the waiting move when its time has come; send the drives their next targets."""
        if self._waiting is not None:
            if self._substeps_to_go == 0:
                super().set_action(self._waiting)
                self._waiting = None
            self._substeps_to_go -= 1
        super().before_simulation_step()


@dataclass
class LateControllerConfig(CartesianControllerConfig):
    """Settings of :class:`LateController`."""

    controller_cls = LateController


def draw_delay_substeps(latency_s: tuple[float, float], physics_hz: int, rng: np.random.Generator) -> int:
    """Physics steps of a delay [s] in this range, uniform over the whole steps that lie nearest to it."""
    low, high = (round(seconds * physics_hz) for seconds in latency_s)
    return int(rng.integers(low, high + 1))
