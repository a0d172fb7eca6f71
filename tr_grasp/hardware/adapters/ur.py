"""UR5 through ``ur-rtde``: set-points by ``servoJ``, 125 a second on a CB3 controller.

Angles are the controller's, which are those of our URDF. Torques are the controller's target moments, gravity included.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from tr_grasp.errors import ConfigError, HardwareError
from tr_grasp.hardware.adapters.extras import maker_package
from tr_grasp.hardware.adapters.remote_clock import RemoteClock
from tr_grasp.hardware.adapters.streamed_arm import StreamedArm
from tr_grasp.hardware.readings import ArmState
from tr_grasp.hardware.real_world import Beats
from tr_grasp.motion import JointState, MotionLimits
from tr_grasp.robots.spec import RobotSpec

RUNNING = 7
"""``ROBOT_MODE_RUNNING``."""
SAFEGUARD_STOPPED, FAULTED = 1 << 4, (1 << 8) | (1 << 9)
"""Of ``getSafetyStatusBits``: safeguard stop; violation and fault."""
WATCHDOG_HZ = 10.0
"""Without a set-point for a tenth of a second the controller ends the program by itself."""
STOP_RAD_S2 = 8.0
MODES = {
    -1: "no controller", 0: "disconnected", 1: "confirm safety", 2: "booting", 3: "power off", 4: "power on",
    5: "idle, brakes on", 6: "backdrive", 8: "updating firmware",
}  # fmt: skip


@dataclass(frozen=True)
class UrCfg:
    """Settings of a UR arm.

    Raises:
        ConfigError: A value that the controller refuses.
    """

    host: str
    """Address of the controller; "remote control" is on where there is that switch."""
    rate_hz: float = 125.0
    """Set-points a second: 125 for CB3, 500 for e-Series."""
    lookahead_s: float = 0.03
    """Smoothing of ``servoJ``, from 0.03 to 0.2; the arm is about as late."""
    gain: float = 300.0
    """Stiffness of ``servoJ``, from 100 to 2000."""

    def __post_init__(self) -> None:
        for name, low, high in (("rate_hz", 20, 500), ("lookahead_s", 0.03, 0.2), ("gain", 100, 2000)):
            if not low <= getattr(self, name) <= high:
                raise ConfigError(f"ur.{name} must be from {low:g} to {high:g}, got {getattr(self, name):g}.")


class UrLink:
    """A UR controller.

    Args:
        control: An ``rtde_control.RTDEControlInterface``.
        receive: An ``rtde_receive.RTDEReceiveInterface``.
        cfg: Settings.
        clock: Ours.
    """

    def __init__(self, control: Any, receive: Any, cfg: UrCfg, clock: Beats) -> None:
        self.rate_hz, self._cfg, self._clock = cfg.rate_hz, cfg, clock
        self._control, self._receive, self._remote = control, receive, RemoteClock()
        self._wanted = False

    def read(self) -> ArmState:
        """Joints as RTDE gives them."""
        receive = self._receive
        if not (receive.isConnected() and self._control.isConnected()):
            raise HardwareError(f"the UR arm at {self._cfg.host} is not connected.")
        stamp = self._remote.local_s(receive.getTimestamp(), self._clock.now_s)
        q, dq, torque = (np.array(values, float) for values in (
            receive.getActualQ(), receive.getActualQd(), receive.getTargetMoment()
        ))  # fmt: skip
        return ArmState(stamp, q, dq, torque, self._fault())

    def ready(self) -> None:
        """See that the control program runs."""
        if not self._control.isProgramRunning() and not self._control.reuploadScript():
            raise HardwareError(
                f"the UR arm at {self._cfg.host} does not start the control program; is it in remote mode?"
            )
        self._control.setWatchdog(WATCHDOG_HZ)
        self._wanted = True

    def send(self, told: JointState, following: JointState) -> None:
        """``servoJ`` to where the arm is to be when the next one comes."""
        cfg = self._cfg
        try:
            taken = self._control.servoJ(following.q.tolist(), 0.0, 0.0, 1.0 / cfg.rate_hz, cfg.lookahead_s, cfg.gain)
            self._control.kickWatchdog()
        except RuntimeError as error:
            raise HardwareError(f"the UR arm at {cfg.host} took no set-point: {error}.") from error
        if not taken:
            raise HardwareError(f"the UR arm at {cfg.host} took no set-point: its control program does not answer.")

    def halt(self) -> None:
        """Brake in the controller."""
        self._wanted = False
        for stop in (self._control.servoStop, self._control.stopJ):
            try:
                stop(STOP_RAD_S2)
            except RuntimeError:  # it is stopped, or gone
                return

    def close(self) -> None:
        """End the program and both connections."""
        with suppress(RuntimeError):
            self._control.stopScript()
        self._control.disconnect()
        self._receive.disconnect()

    def _fault(self) -> str:
        receive = self._receive
        if receive.isEmergencyStopped():
            return "emergency stop"
        if receive.isProtectiveStopped():
            return "protective stop; unlock it on the teach pendant"
        bits, mode = receive.getSafetyStatusBits(), receive.getRobotMode()
        if bits & SAFEGUARD_STOPPED:
            return "safeguard stop"
        if bits & FAULTED:
            return "a safety violation or fault"
        if mode != RUNNING:
            return f"the robot is not running (mode {mode}: {MODES.get(mode, 'unknown')})"
        if self._wanted and not self._control.isProgramRunning():
            return "its control program has ended"
        return ""


def open_arm(spec: RobotSpec, cfg: UrCfg, clock: Beats) -> StreamedArm:
    """Connect to a controller.

    Raises:
        HardwareError: ur-rtde is missing, or nobody answers.
    """
    what = "the arm 'ur5'"
    control = maker_package("rtde_control", "ur", what).RTDEControlInterface
    receive = maker_package("rtde_receive", "ur", what).RTDEReceiveInterface
    try:
        # Receiving first: it needs no program on the controller, so a wrong address shows at once.
        link = UrLink(
            receive=receive(cfg.host, cfg.rate_hz), control=control(cfg.host, cfg.rate_hz), cfg=cfg, clock=clock
        )
    except RuntimeError as error:
        raise HardwareError(f"no UR controller answers at {cfg.host}: {error}.") from error
    return StreamedArm(spec.name, MotionLimits.of(spec), link, clock)
