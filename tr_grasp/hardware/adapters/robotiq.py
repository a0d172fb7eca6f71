"""Robotiq 2F-85 through the URCap's socket: lines of ASCII, ``SET POS 128`` and ``GET POS``, on port 63352 of the arm.

Counts go from 0, open, to 255, closed; where the fingers really end is calibrated. Speed and force are counts of their
ranges in the datasheet. The protocol: Robotiq's URCap; the registers: instruction manual of the 2F-85, section 4.
"""

from __future__ import annotations

import socket
from dataclasses import dataclass

from tr_grasp.errors import ConfigError, HardwareError
from tr_grasp.hardware.adapters.polled_gripper import PolledGripper
from tr_grasp.hardware.fingers import FingerGoal
from tr_grasp.hardware.readings import GripperState
from tr_grasp.hardware.real_world import Beats
from tr_grasp.robots.parts import GripperSpec

FULL = 255
ACTIVE, MOVING, STOPPED_OPENING, STOPPED_CLOSING = 3, 0, 1, 2
"""``STA`` when it works; ``OBJ``."""
FAULTS = {
    5: "it must be activated first", 7: "its activation bit is not set", 8: "it is too hot", 9: "no communication",
    10: "its supply voltage is too low", 11: "an automatic release goes on", 12: "internal fault",
    13: "activation fault", 14: "overcurrent", 15: "an automatic release is over",
}  # fmt: skip


@dataclass(frozen=True)
class RobotiqCfg:
    """Settings of a Robotiq gripper.

    Raises:
        ConfigError: Counts out of order.
    """

    host: str
    """Address of the UR controller."""
    port: int = 63352
    """Of the URCap."""
    open_count: int = 3
    """``POS`` with open fingers."""
    closed_count: int = 230
    """``POS`` with closed fingers."""
    timeout_s: float = 0.5
    """For one answer."""
    rate_hz: float = 30.0
    """How often it is asked; five questions each."""

    def __post_init__(self) -> None:
        if not 0 <= self.open_count < self.closed_count <= FULL:
            raise ConfigError(
                f"robotiq.open_count and closed_count must ascend within 0 to {FULL}, "
                f"got {self.open_count} and {self.closed_count}."
            )


class RobotiqLink:
    """A 2F-85.

    Args:
        spec: Its ranges.
        cfg: Settings.
        clock: Ours.

    Raises:
        HardwareError: Nobody answers, or it is not activated.
    """

    knows_speed = True

    def __init__(self, spec: GripperSpec, cfg: RobotiqCfg, clock: Beats) -> None:
        self._spec, self._cfg, self._clock, self.rate_hz = spec, cfg, clock, cfg.rate_hz
        self._force_n, self._requested = 0.0, -1
        try:
            self._socket = socket.create_connection((cfg.host, cfg.port), cfg.timeout_s)
        except OSError as error:
            raise HardwareError(f"no Robotiq gripper answers at {cfg.host}:{cfg.port}: {error}.") from error
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        if self._get("STA") != ACTIVE:
            # Activating opens and closes the fingers, which nobody asked for.
            raise HardwareError("the Robotiq gripper is not activated; activate it on the teach pendant.")

    def read(self) -> GripperState:
        """Position and object register."""
        now, fault, status = self._clock.now_s, self._get("FLT"), self._get("STA")
        count, state = self._get("POS"), self._get("OBJ")
        asked = self._get("PRE")
        waits = self._requested >= 0 and asked != self._requested
        holding = state in (STOPPED_OPENING, STOPPED_CLOSING) and not waits
        reason = FAULTS.get(fault, f"fault {fault}") if fault else "" if status == ACTIVE else "it is not activated"
        force = self._force_n if holding else 0.0
        return GripperState(now, self.opening_m(count), force, state == MOVING or waits, holding, reason)

    def go(self, goal: FingerGoal) -> None:
        """``SET`` all at once."""
        self._requested, self._force_n = self.count(goal.opening_m), goal.force_n
        speed = _share(goal.speed_mps, self._spec.speed_range_mps)
        force = _share(goal.force_n, self._spec.force_range_n)
        self._say(f"SET POS {self._requested} SPE {speed} FOR {force} GTO 1")

    def halt(self) -> None:
        """Stay where it is."""
        self._requested = -1
        try:
            self._say("SET GTO 0")
        except HardwareError:  # it is gone, and the state says so
            return

    def close(self) -> None:
        """Hang up."""
        self._socket.close()

    def count(self, opening_m: float) -> int:
        """Position in counts."""
        low, high = self._spec.opening_range_m
        share = (high - opening_m) / (high - low)
        return round(self._cfg.open_count + share * (self._cfg.closed_count - self._cfg.open_count))

    def opening_m(self, count: int) -> float:
        """Distance between the pads at a position."""
        low, high = self._spec.opening_range_m
        share = (count - self._cfg.open_count) / (self._cfg.closed_count - self._cfg.open_count)
        return high - min(max(share, 0.0), 1.0) * (high - low)

    def _get(self, name: str) -> int:
        answer = self._ask(f"GET {name}")
        key, _, value = answer.partition(" ")
        if key != name or not value.isdigit():
            # In an emergency stop the URCap answers "?".
            raise HardwareError(f"the Robotiq gripper does not tell {name}, it answers {answer!r}; is the arm stopped?")
        return int(value)

    def _say(self, line: str) -> None:
        if (answer := self._ask(line)) != "ack":
            raise HardwareError(f"the Robotiq gripper refused {line!r} with {answer!r}.")

    def _ask(self, line: str) -> str:
        try:
            self._socket.sendall(f"{line}\n".encode())
            answer = self._socket.recv(1024)
        except OSError as error:
            raise HardwareError(f"the Robotiq gripper is not connected: {error}.") from error
        if not answer:
            raise HardwareError("the Robotiq gripper is not connected: it hung up.")
        return answer.decode("ascii", "replace").strip()


def _share(value: float, limits: tuple[float, float]) -> int:
    low, high = limits
    return round(FULL * (value - low) / (high - low))


def open_gripper(spec: GripperSpec, cfg: RobotiqCfg, clock: Beats) -> PolledGripper:
    """Connect to a gripper.

    Raises:
        HardwareError: Nobody answers, or it is not activated.
    """
    return PolledGripper(spec, RobotiqLink(spec, cfg, clock), clock)
