"""Kinova's KG-3 hand, through the same driver as its arm.

Positions are motor turns: 0 is open, 6800 closed. The driver has an action for positions, without speed or force, so
the fingers are led in steps and what they press with is not known.
"""

from __future__ import annotations

import threading
from typing import Any

from tr_grasp.errors import HardwareError
from tr_grasp.hardware.adapters.kinova import KinovaCfg, Rosbridge
from tr_grasp.hardware.adapters.polled_gripper import PolledGripper
from tr_grasp.hardware.fingers import FingerGoal
from tr_grasp.hardware.readings import GripperState
from tr_grasp.hardware.real_world import Beats
from tr_grasp.robots.parts import GripperSpec

CLOSED_TURNS = 6800.0
ACTION = "fingers_action/finger_positions"
STILL_TURNS, STILL_S = 20.0, 0.25
"""Fingers that move less than this for so long stand still."""
NEAR_TURNS = 150.0


class Kg3Link:
    """The fingers of a ``kinova_driver``.

    Args:
        spec: Their ranges.
        bridge: To the driver.
        cfg: Settings.
        clock: Ours.
        own: The connection is nobody else's, and hung up at the end.

    Raises:
        HardwareError: No position comes.
    """

    knows_speed = False
    rate_hz = 25.0

    def __init__(
        self, spec: GripperSpec, bridge: Rosbridge, cfg: KinovaCfg, clock: Beats, *, own: bool = False
    ) -> None:
        self._spec, self._bridge, self._clock, self._own = spec, bridge, clock, own
        self._goals = bridge.topic(cfg.topic(f"{ACTION}/goal"), "kinova_msgs/SetFingersPositionActionGoal")
        self._cancels = bridge.topic(cfg.topic(f"{ACTION}/cancel"), "actionlib_msgs/GoalID")
        self._positions = bridge.topic(cfg.topic("out/finger_position"), "kinova_msgs/FingerPosition")
        self._came, self._turns, self._stamp_s = threading.Event(), 0.0, 0.0
        self._mark, self._mark_s = 0.0, clock.now_s
        self._goal: float | None = None
        self._goals.advertise()
        self._cancels.advertise()
        self._positions.subscribe(self._on_position)
        if not self._came.wait(cfg.timeout_s):
            raise HardwareError(f"no finger position comes on {self._positions.name}; is kinova_driver running?")

    def read(self) -> GripperState:
        """Where the fingers are, and whether something stopped them."""
        self._bridge.check()
        still = self._clock.now_s - self._mark_s > STILL_S
        gap = 0.0 if self._goal is None else self._goal - self._turns
        # An object stops fingers that close; what is left of an opening way is no grip.
        holding = still and gap > NEAR_TURNS
        moving = self._goal is not None and not still and abs(gap) > STILL_TURNS
        return GripperState(self._stamp_s, self.opening_m(self._turns), 0.0, moving, holding)

    def go(self, goal: FingerGoal) -> None:
        """A goal of the action; a later one takes over."""
        turns = self.turns(goal.opening_m)
        if self._goal is None:
            self._mark, self._mark_s = self._turns, self._clock.now_s
        self._goal = turns
        fingers = {f"finger{number}": turns for number in (1, 2, 3)}
        self._goals.publish({"goal_id": {"stamp": {"secs": 0, "nsecs": 0}, "id": ""}, "goal": {"fingers": fingers}})

    def halt(self) -> None:
        """Cancel all goals."""
        self._goal = None
        if self._bridge.ros.is_connected:
            self._cancels.publish({"stamp": {"secs": 0, "nsecs": 0}, "id": ""})

    def close(self) -> None:
        """Leave the driver."""
        if self._bridge.ros.is_connected:
            self._positions.unsubscribe()
        if self._own:
            self._bridge.close()

    def turns(self, opening_m: float) -> float:
        """Motor turns at an opening."""
        return CLOSED_TURNS * (1.0 - self._spec.openness(opening_m))

    def opening_m(self, turns: float) -> float:
        """Distance of the thumb from the fingers at motor turns."""
        return self._spec.opening_at(1.0 - turns / CLOSED_TURNS)

    def _on_position(self, message: dict[str, Any]) -> None:
        self._turns = sum(float(message[f"finger{number}"]) for number in (1, 2, 3)) / 3
        self._stamp_s = self._clock.now_s
        if abs(self._turns - self._mark) > STILL_TURNS:
            self._mark, self._mark_s = self._turns, self._stamp_s
        self._came.set()


def open_gripper(spec: GripperSpec, cfg: KinovaCfg, clock: Beats, bridge: Rosbridge | None = None) -> PolledGripper:
    """Connect to the fingers; over a connection that exists already, if there is one.

    Raises:
        HardwareError: roslibpy is missing, nobody answers, or no position comes.
    """
    link = Kg3Link(spec, bridge or Rosbridge(cfg), cfg, clock, own=bridge is None)
    return PolledGripper(spec, link, clock)
