"""Virtual time that device adapters can run on, and fingers that move in it."""

from __future__ import annotations

import numpy as np

from tr_grasp.hardware.virtual_world import VirtualWorld

TICK_S = 0.002


class SteppedWorld(VirtualWorld):
    """A virtual world that calls back at a rate, as the real one does.

    The devices of a test are stepped before the beats, so that a beat reads what was true just now.
    """

    def __init__(self, tick_s=TICK_S):
        super().__init__(tick_s=tick_s)

    def listeners_first(self, listener):
        """As ``on_tick``, before all that are there."""
        self._listeners.insert(0, listener)

    def every(self, period_s, beat):
        state = {"next": self.now_s + period_s, "on": True}

        def listener(_):
            if state["on"] and self.now_s >= state["next"] - 1e-9:
                state["next"] += period_s
                beat()

        self.on_tick(listener)

        def end():
            state["on"] = False

        return end


class Fingers:
    """Fingers that go to a position at a speed, and stop at what is between them."""

    def __init__(self, position, closed_sign):
        self.position = self.goal = float(position)
        self.speed, self.closed_sign, self.blocked_at, self.holding = 0.0, closed_sign, None, False

    @property
    def moving(self):
        return self.position != self.goal and not self.holding

    def step(self, dt_s):
        way = float(np.clip(self.goal - self.position, -self.speed * dt_s, self.speed * dt_s))
        wanted = self.position + way
        closing, stop = way * self.closed_sign > 0, self.blocked_at
        if stop is not None and closing and (wanted - stop) * self.closed_sign >= 0:
            self.position, self.holding = stop, True
        else:
            self.holding = self.holding and way * self.closed_sign > 0
            self.position = wanted

    def go(self, goal, speed):
        self.goal, self.speed = goal, speed
        self.holding = self.holding and (goal - self.position) * self.closed_sign > 0

    def stop(self):
        self.goal = self.position
