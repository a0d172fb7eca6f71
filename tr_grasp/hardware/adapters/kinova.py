"""Kinova j2s7s300 with its KG-3 hand, through rosbridge (``roslibpy``) to ``kinova-ros``.

The arm takes joint velocities in degrees a second, exactly 100 of them a second: its processor uses one every 10 ms,
fewer make it slower and more fill a buffer of 2000 that it goes on to empty. Source: kinova-ros, README, "Velocity
control". States come in radians, wrapped by the driver; ``status_interval_seconds`` of the driver must be 0.02 or less
(it is 0.1 by default).
"""

from __future__ import annotations

import threading
from collections import deque
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
from tr_grasp.motion.arguments import Array
from tr_grasp.robots.spec import RobotSpec

RATE_HZ = 100.0
"""Not a setting: the arm's own cycle."""
TOLD_S = 0.5
"""How far back the commanded joints are kept, to compare states with what was commanded when they were true."""


@dataclass(frozen=True)
class KinovaCfg:
    """Settings of a Kinova arm.

    Raises:
        ConfigError: A gain that would not settle.
    """

    host: str
    """Address of rosbridge."""
    port: int = 9090
    """Of rosbridge."""
    robot: str = "j2s7s300"
    """``kinova_robotType`` of the driver; its topics begin with it."""
    gain_hz: float = 2.0
    """Part of the error of the joints that is made up for per second."""
    timeout_s: float = 5.0
    """For the connection, and for the first state."""

    def __post_init__(self) -> None:
        if not 0 <= self.gain_hz <= 8:
            raise ConfigError(f"kinova.gain_hz must be from 0 to 8, or the arm swings, got {self.gain_hz:g}.")

    def topic(self, name: str) -> str:
        """Of the driver."""
        return f"/{self.robot}_driver/{name}"


class Rosbridge:
    """A connection to rosbridge.

    Args:
        cfg: Where.

    Raises:
        HardwareError: roslibpy is missing, or nobody answers.
    """

    def __init__(self, cfg: KinovaCfg) -> None:
        self._lib = maker_package("roslibpy", "kinova", "the arm 'j2s7s300'")
        self._where = f"{cfg.host}:{cfg.port}"
        try:
            self.ros = self._connected(cfg)
        except Exception as error:  # roslibpy raises its own, and those of Twisted
            raise HardwareError(f"no rosbridge answers at {self._where}: {error}.") from error

    def topic(self, name: str, kind: str) -> Any:
        """To publish on or subscribe to; of what waits, only the newest is kept."""
        return self._lib.Topic(self.ros, name, kind, queue_size=1, queue_length=1)

    def call(self, name: str, kind: str) -> None:
        """Call a service without waiting; in order with what is published."""
        self._lib.Service(self.ros, name, kind).call(self._lib.ServiceRequest(), lambda _: None, lambda _: None)

    def check(self) -> None:
        """Raise if it is gone.

        Raises:
            HardwareError: It is.
        """
        if not self.ros.is_connected:
            raise HardwareError(f"rosbridge at {self._where} is not connected.")

    def close(self) -> None:
        """Hang up, also if it is gone already."""
        try:
            self.ros.close()
        finally:
            _give_up(self.ros)

    def _connected(self, cfg: KinovaCfg) -> Any:
        ros = self._lib.Ros(host=cfg.host, port=cfg.port, transport="twisted")
        ros.factory.on("ready", _send_at_once)
        try:
            ros.run(timeout=cfg.timeout_s)
        except Exception:
            _give_up(ros)
            raise
        return ros


def _give_up(ros: Any) -> None:
    """Call no more: by itself roslibpy would for ever, at intervals that it draws from Python's random generator."""

    def give_up() -> None:
        ros.factory.stopTrying()
        ros.factory.connector.disconnect()

    ros.call_later(0, give_up)


def _send_at_once(protocol: Any) -> None:
    """Have small messages sent one by one: by itself TCP gathers them, and the arm would get two every 20 ms."""
    transport = getattr(protocol, "transport", None)
    if transport is not None and hasattr(transport, "setTcpNoDelay"):
        transport.setTcpNoDelay(True)


class KinovaLink:
    """The arm of a ``kinova_driver``.

    Args:
        spec: The robot.
        bridge: To it.
        cfg: Settings.
        clock: Ours.

    Raises:
        HardwareError: No state comes.
    """

    rate_hz = RATE_HZ

    def __init__(self, spec: RobotSpec, bridge: Rosbridge, cfg: KinovaCfg, clock: Beats) -> None:
        self._spec, self._bridge, self._cfg, self._clock = spec, bridge, cfg, clock
        self._limits, self._remote = MotionLimits.of(spec), RemoteClock()
        self._velocity = bridge.topic(cfg.topic("in/joint_velocity"), "kinova_msgs/JointVelocity")
        self._states = bridge.topic(cfg.topic("out/joint_state"), "sensor_msgs/JointState")
        self._came, self._seen = threading.Event(), None
        self._told: deque[tuple[float, Array]] = deque()
        self._turn = np.array(spec.home_q_rad)
        self._velocity.advertise()
        self._states.subscribe(self._on_state)
        if not self._came.wait(cfg.timeout_s):
            raise HardwareError(f"no joint state comes on {self._states.name}; is kinova_driver running?")

    def read(self) -> ArmState:
        """The newest that has come."""
        self._bridge.check()
        assert self._seen is not None
        return self._seen

    def ready(self) -> None:
        """Let the driver take commands."""
        self._told.clear()
        self._bridge.call(self._cfg.topic("in/start"), "kinova_msgs/Start")

    def send(self, told: JointState, following: JointState) -> None:
        """The speed that brings the joints to where they are to be in 10 ms, and makes up for what is missing."""
        now, state = self._clock.now_s, self.read()
        self._told.append((now, told.q))
        while self._told[0][0] < now - TOLD_S:
            self._told.popleft()
        missing = self._told_at(state.stamp_s) - state.q_rad
        speed = (following.q - told.q) * RATE_HZ + self._cfg.gain_hz * missing
        most = self._limits.velocity_rad_s
        self._publish(np.clip(speed, -most, most))

    def halt(self) -> None:
        """Stop, empty the driver's buffer, and take no more."""
        if self._bridge.ros.is_connected:
            self._publish(np.zeros(len(self._turn)))
            self._bridge.call(self._cfg.topic("in/stop"), "kinova_msgs/Stop")

    def close(self) -> None:
        """Hang up."""
        if self._bridge.ros.is_connected:
            self._states.unsubscribe()
            self._velocity.unadvertise()
        self._bridge.close()

    def _publish(self, speed_rad_s: Array) -> None:
        degrees = np.degrees(speed_rad_s).tolist()
        self._velocity.publish({f"joint{number}": value for number, value in enumerate(degrees, start=1)})

    def _told_at(self, time_s: float) -> Array:
        times = [time for time, _ in self._told]
        joints = np.stack([q for _, q in self._told])
        return np.array([np.interp(time_s, times, column) for column in joints.T])

    def _on_state(self, message: dict) -> None:
        arrival = self._clock.now_s
        stamp = message["header"]["stamp"]
        # ROS 1 says secs and nsecs, ROS 2 sec and nanosec.
        sent = stamp.get("secs", stamp.get("sec", 0)) + 1e-9 * stamp.get("nsecs", stamp.get("nanosec", 0))
        where = {name: i for i, name in enumerate(message["name"])}
        order = [where.get(name, -1) for name in self._spec.joint_names]
        if min(order) < 0:
            return
        q, dq, effort = (_picked(message.get(name), order) for name in ("position", "velocity", "effort"))
        # The driver tells continuous joints within a turn, so a joint that passes 360 degrees would seem to jump.
        near = self._turn + np.remainder(q - self._turn + np.pi, 2 * np.pi) - np.pi
        self._turn = near
        self._seen = ArmState(self._remote.local_s(sent, arrival), near, dq, effort)
        self._came.set()


def _picked(values: list[float] | None, order: list[int]) -> Array:
    """Values of our joints; zeros where the driver tells none."""
    if values is None or len(values) <= max(order):
        return np.zeros(len(order))
    return np.array([values[i] for i in order], float)


def open_arm(spec: RobotSpec, cfg: KinovaCfg, clock: Beats, bridge: Rosbridge | None = None) -> StreamedArm:
    """Connect to a driver.

    Args:
        spec: The robot.
        cfg: Settings.
        clock: Ours.
        bridge: A connection that exists already.

    Raises:
        HardwareError: roslibpy is missing, nobody answers, or no state comes.
    """
    link = KinovaLink(spec, bridge or Rosbridge(cfg), cfg, clock)
    return StreamedArm(spec.name, MotionLimits.of(spec), link, clock)
