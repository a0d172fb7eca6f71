"""OnRobot RG2 on a UR arm, through the XML-RPC server of OnRobot's URCap on port 41414 of the controller.

Widths are millimetres there. The older way, bits over the tool's digital outputs, needs a script that takes the place
of the one that moves the arm, and tells the width by a voltage; this one leaves the arm alone and answers. The
gripper has no speed to set, so it is led there in steps.
"""

from __future__ import annotations

import xmlrpc.client
from dataclasses import dataclass
from typing import Any

from tr_grasp.errors import HardwareError
from tr_grasp.hardware.adapters.polled_gripper import PolledGripper
from tr_grasp.hardware.fingers import FingerGoal
from tr_grasp.hardware.readings import GripperState
from tr_grasp.hardware.real_world import Beats
from tr_grasp.robots.parts import GripperSpec


@dataclass(frozen=True)
class Rg2Cfg:
    """Settings of an RG2."""

    host: str
    """Address of the UR controller."""
    port: int = 41414
    """Of the URCap's XML-RPC server."""
    tool_index: int = 0
    """0 for a single gripper; 1 and 2 on a dual changer."""
    timeout_s: float = 0.5
    """For one answer."""
    rate_hz: float = 25.0
    """How often it is asked and led on."""


class _Transport(xmlrpc.client.Transport):
    """HTTP with a time limit."""

    def __init__(self, timeout_s: float) -> None:
        super().__init__()
        self._timeout_s = timeout_s

    def make_connection(self, host: Any) -> Any:
        connection = super().make_connection(host)
        connection.timeout = self._timeout_s
        return connection


class Rg2Link:
    """An RG2.

    Args:
        cfg: Settings.
        clock: Ours.
    """

    knows_speed = False

    def __init__(self, cfg: Rg2Cfg, clock: Beats) -> None:
        self._cfg, self._clock, self.rate_hz = cfg, clock, cfg.rate_hz
        address = f"http://{cfg.host}:{cfg.port}/"
        self._server = xmlrpc.client.ServerProxy(address, transport=_Transport(cfg.timeout_s))
        self._force_n = 0.0

    def read(self) -> GripperState:
        """Width, whether it is busy, whether it holds something."""
        now = self._clock.now_s
        width_mm, busy = float(self._call("rg_get_width")), bool(self._call("rg_get_busy"))
        holding = bool(self._call("rg_get_grip_detected")) and not busy
        fault = "its safety switch has been pressed" if self._call("rg_get_safety_failed") else ""
        return GripperState(now, 1e-3 * width_mm, self._force_n if holding else 0.0, busy, holding, fault)

    def go(self, goal: FingerGoal) -> None:
        """``rg_grip``; a later one takes over."""
        self._force_n = goal.force_n
        self._call("rg_grip", 1e3 * goal.opening_m, float(goal.force_n))

    def halt(self) -> None:
        """``rg_stop``."""
        try:
            self._call("rg_stop")
        except HardwareError:  # it is gone, and the state says so
            return

    def close(self) -> None:
        """Hang up."""
        self._server("close")()

    def _call(self, name: str, *arguments: float) -> Any:
        try:
            return getattr(self._server, name)(self._cfg.tool_index, *arguments)
        except xmlrpc.client.Fault as error:
            raise HardwareError(f"the RG2 refused {name}: {error.faultString}.") from error
        except (OSError, xmlrpc.client.Error, ValueError) as error:
            where = f"{self._cfg.host}:{self._cfg.port}"
            raise HardwareError(f"no RG2 answers at {where}; is OnRobot's URCap running? ({error})") from error


def open_gripper(spec: GripperSpec, cfg: Rg2Cfg, clock: Beats) -> PolledGripper:
    """Connect to a gripper.

    Raises:
        HardwareError: Nobody answers.
    """
    return PolledGripper(spec, Rg2Link(cfg, clock), clock)
