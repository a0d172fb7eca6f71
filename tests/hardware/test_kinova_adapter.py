"""Kinova arm and hand through roslibpy, a WebSocket and a fake rosbridge; time is virtual, the network is not."""

import threading

import pytest

pytest.importorskip("roslibpy")

from tests.hardware.contract import BackendContract
from tests.hardware.transports.rosbridge import RosbridgeServer
from tests.hardware.transports.stepped import SteppedWorld
from tr_grasp.hardware import Station
from tr_grasp.hardware.adapters import kg3, kinova
from tr_grasp.robots import robot_spec

SPEC = robot_spec("j2s7s300")


class Laboratory:
    """A driver, a bridge to it, the devices on it, and a world that goes on only when everybody has heard everything."""

    def __init__(self):
        self.world = SteppedWorld(tick_s=0.01)
        self.server = RosbridgeServer(SPEC.home_q_rad, lambda: self.world.now_s)
        self.cfg = kinova.KinovaCfg("127.0.0.1", self.server.port, timeout_s=3.0)
        self.bridge = kinova.Rosbridge(self.cfg)
        self.sync = self.bridge._lib.Service(self.bridge.ros, "/sync", "std_srvs/Empty")
        opened = []
        # Until the first states have come time stands still, so they are published again and again.
        opening = threading.Thread(target=lambda: opened.extend(self.open()))
        opening.start()
        while opening.is_alive():
            self.server.driver.publish(self.world.now_s)
            opening.join(0.02)
        self.arm, self.gripper = opened
        self.world.listeners_first(self.step)
        self.settle()

    def open(self):
        arm = kinova.open_arm(SPEC, self.cfg, self.world, self.bridge)
        return arm, kg3.open_gripper(SPEC.gripper, self.cfg, self.world, self.bridge)

    def step(self, _):
        self.settle()
        if self.server.step():
            self.settle()

    def settle(self):
        """Wait until both ends have heard what the other said."""
        if self.bridge.ros.is_connected and self.server.clients:
            self.sync.call(self.bridge._lib.ServiceRequest(), timeout=5)

    @property
    def station(self):
        return Station(self.arm, self.gripper, self.world)

    def close(self):
        self.gripper.close()
        self.arm.close()
        self.server.close()


@pytest.fixture
def lab():
    made = Laboratory()
    yield made
    made.close()


class TestKinova(BackendContract):
    @pytest.fixture
    def station(self, lab):
        return lab.station
