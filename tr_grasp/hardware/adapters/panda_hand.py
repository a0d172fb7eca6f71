"""Franka Hand through ``panda-python``: calls last until the fingers stand still, so a thread of its own makes them.

Closing fully is a grasp, with the force asked for; to any other opening the hand moves, with a force of its own.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

from tr_grasp.errors import HardwareError
from tr_grasp.hardware.adapters.extras import maker_package
from tr_grasp.hardware.adapters.polled_gripper import PolledGripper
from tr_grasp.hardware.fingers import FingerGoal
from tr_grasp.hardware.readings import GripperState
from tr_grasp.hardware.real_world import Beats
from tr_grasp.robots.parts import GripperSpec

CLOSED_M = 1e-3
"""Openings up to this are grasps."""


@dataclass(frozen=True)
class PandaHandCfg:
    """Settings of a Franka Hand."""

    host: str
    """Address of the arm's control."""
    rate_hz: float = 25.0
    """How often it is asked."""


class PandaHandLink:
    """A Franka Hand.

    Args:
        hand: A ``panda_py.libfranka.Gripper``, after homing.
        spec: Its ranges.
        cfg: Settings.
        clock: Ours.
        submit: Starts a call in another thread.
    """

    knows_speed = True

    def __init__(
        self,
        hand: Any,
        spec: GripperSpec,
        cfg: PandaHandCfg,
        clock: Beats,
        submit: Callable[[Callable[[], bool]], Future[bool]] | None = None,
    ) -> None:
        self._hand, self._spec, self._cfg, self._clock, self.rate_hz = hand, spec, cfg, clock, cfg.rate_hz
        self._submit = submit or ThreadPoolExecutor(1, "tr_grasp hand").submit
        self._call: Future[bool] | None = None
        self._force_n = 0.0

    def read(self) -> GripperState:
        """Width, and whether it holds something."""
        now = self._clock.now_s
        try:
            state = self._hand.read_once()
        except RuntimeError as error:
            raise HardwareError(f"the Franka Hand at {self._cfg.host} is not connected: {error}.") from error
        moving = self._call is not None and not self._call.done()
        holding = bool(state.is_grasped) and not moving
        return GripperState(
            now, float(state.width), self._force_n if holding else 0.0, moving, holding, self._failure()
        )

    def go(self, goal: FingerGoal) -> None:
        """Grasp or move, in the other thread; what goes on is stopped first."""
        self._stop()
        if goal.opening_m <= self._spec.opening_range_m[0] + CLOSED_M:
            self._force_n, most = goal.force_n, self._spec.opening_range_m[1]
            # Whatever is between the fingers counts as grasped, however wide.
            self._call = self._submit(lambda: self._hand.grasp(goal.opening_m, goal.speed_mps, goal.force_n, 0.0, most))
        else:
            self._force_n = 0.0
            self._call = self._submit(lambda: self._hand.move(goal.opening_m, goal.speed_mps))

    def halt(self) -> None:
        """Stop the fingers."""
        try:
            self._stop()
        except HardwareError:  # it is gone, and the state says so
            return

    def close(self) -> None:
        """Stop the fingers."""
        self.halt()

    def _stop(self) -> None:
        if self._call is None or self._call.done():
            return
        try:
            self._hand.stop()
        except RuntimeError as error:
            raise HardwareError(f"the Franka Hand at {self._cfg.host} does not stop: {error}.") from error

    def _failure(self) -> str:
        """What the last call died of; a grasp of nothing is no failure, and says so by its answer alone."""
        if self._call is None or not self._call.done() or (error := self._call.exception()) is None:
            return ""
        self._call = None
        return "" if "abort" in str(error).lower() else str(error)


def open_gripper(spec: GripperSpec, cfg: PandaHandCfg, clock: Beats) -> PolledGripper:
    """Connect to a hand that has been homed.

    Raises:
        HardwareError: panda-python is missing, or nobody answers.
    """
    libfranka = maker_package("panda_py.libfranka", "franka", "the gripper 'panda_hand'")
    try:
        hand = libfranka.Gripper(cfg.host)
    except Exception as error:  # libfranka's exceptions have no common class in Python
        raise HardwareError(f"no Franka Hand answers at {cfg.host}: {error}.") from error
    return PolledGripper(spec, PandaHandLink(hand, spec, cfg, clock), clock)
