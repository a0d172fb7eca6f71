"""Franka Emika Panda through ``panda-python``: its joint position controller gets a position and a speed at every beat.

The controller itself runs at 1 kHz in panda-python's own thread. Torques are the external ones that the arm estimates.
"""

from __future__ import annotations

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

MODES = {
    "kUserStopped": "emergency stop: the user stop is pressed",
    "kReflex": "a reflex stopped it; press and release the user stop when nothing is in the way",
    "kGuiding": "somebody guides it by hand",
    "kAutomaticErrorRecovery": "it recovers from an error",
    "kOther": "it is not ready; unlock its joints and activate FCI in Desk",
}
"""Of ``RobotMode``; the others, idle and moving, are fine."""


@dataclass(frozen=True)
class PandaCfg:
    """Settings of a Panda.

    Raises:
        ConfigError: A rate outside the range.
    """

    host: str
    """Address of the control."""
    rate_hz: float = 250.0
    """Set-points a second, up to the arm's own 1000."""

    def __post_init__(self) -> None:
        if not 50 <= self.rate_hz <= 1000:
            raise ConfigError(f"panda.rate_hz must be from 50 to 1000, got {self.rate_hz:g}.")


class PandaLink:
    """A Panda.

    Args:
        panda: A ``panda_py.Panda``.
        make_controller: Makes a ``panda_py.controllers.JointPosition``.
        cfg: Settings.
        clock: Ours.
    """

    def __init__(self, panda: Any, make_controller: Any, cfg: PandaCfg, clock: Beats) -> None:
        self.rate_hz, self._cfg, self._clock = cfg.rate_hz, cfg, clock
        self._panda: Any = panda
        self._make_controller, self._remote = make_controller, RemoteClock()
        self._controller: Any = None

    def read(self) -> ArmState:
        """The last state that libfranka received."""
        state = self._panda.get_state()
        stamp = self._remote.local_s(state.time.to_sec(), self._clock.now_s)
        q, dq, effort = (np.array(values, float) for values in (state.q, state.dq, state.tau_ext_hat_filtered))
        return ArmState(stamp, q, dq, effort, self._fault(state))

    def ready(self) -> None:
        """Recover from errors and start the controller where the arm is."""
        try:
            self._panda.recover()
            self._controller = self._make_controller()
            self._panda.start_controller(self._controller)
        except RuntimeError as error:
            self._controller = None
            raise HardwareError(f"the Panda at {self._cfg.host} does not start moving: {error}.") from error

    def send(self, told: JointState, following: JointState) -> None:
        """Where to be when the next one comes."""
        if self._controller is None:
            raise HardwareError(f"the Panda at {self._cfg.host} has no controller.")
        self._controller.set_control(following.q, following.dq)

    def halt(self) -> None:
        """End the controller: the arm brakes and holds."""
        self._controller = None
        try:
            self._panda.stop_controller()
        except RuntimeError:  # it has ended, or the arm is gone
            return

    def close(self) -> None:
        """Nothing more: libfranka hangs up with its last object."""
        self._panda = None

    def _fault(self, state: Any) -> str:
        mode = getattr(state.robot_mode, "name", str(state.robot_mode))
        if mode in MODES:
            return MODES[mode]
        if self._controller is not None:
            try:
                self._panda.raise_error()
            except RuntimeError as error:
                return str(error)
        return ""


def open_arm(spec: RobotSpec, cfg: PandaCfg, clock: Beats) -> StreamedArm:
    """Connect to an arm.

    Raises:
        HardwareError: panda-python is missing, nobody answers, or the arm is not ready.
    """
    panda_py = maker_package("panda_py", "franka", "the arm 'panda'")
    controllers = maker_package("panda_py.controllers", "franka", "the arm 'panda'")
    try:
        panda = panda_py.Panda(cfg.host)
    except Exception as error:  # libfranka's exceptions have no common class in Python
        raise HardwareError(f"no Panda answers at {cfg.host}: {error}.") from error
    return StreamedArm(spec.name, MotionLimits.of(spec), PandaLink(panda, controllers.JointPosition, cfg, clock), clock)
