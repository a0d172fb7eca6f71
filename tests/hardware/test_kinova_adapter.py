"""Kinova arm and hand through roslibpy, a WebSocket and a fake rosbridge; time is virtual, the network is not."""

import threading

import numpy as np
import pytest

pytest.importorskip("roslibpy")

from tests.hardware.contract import BackendContract, way
from tests.hardware.transports.rosbridge import RosbridgeServer
from tests.hardware.transports.stepped import SteppedWorld
from tr_grasp.errors import HardwareError
from tr_grasp.hardware import Ending, Guard, GuardCfg, Station, finish
from tr_grasp.hardware.adapters import kg3, kinova
from tr_grasp.motion import Kinematics
from tr_grasp.robots import robot_spec

SPEC = robot_spec("j2s7s300")


class Laboratory:
    """A driver, a bridge to it, the devices on it, and a world that waits until both ends have heard all."""

    def __init__(self):
        self.world = SteppedWorld(tick_s=0.01)
        self.server = RosbridgeServer(SPEC.home_q_rad, lambda: self.world.now_s)
        self.cfg = kinova.KinovaCfg("127.0.0.1", self.server.port, timeout_s=20.0)
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


def wait_for(condition):
    """The network is real: give it two seconds to do what is due."""
    for _ in range(200):
        if condition():
            break
        threading.Event().wait(0.01)


def calls_due():
    """Connections that Twisted's thread is to try again later."""
    from twisted.internet import reactor, threads

    def due():
        return [call for call in reactor.getDelayedCalls() if call.func.__name__ == "reconnector"]

    return threads.blockingCallFromThread(reactor, due)


def underway(lab):
    """The arm in the middle of a motion."""
    command = lab.arm.move(way(lab.station, 0.2))
    lab.world.wait(0.3)
    assert np.abs(lab.arm.state().dq_rad_s).max() > 0.1
    return command


def test_speeds_are_degrees_a_second_exactly_100_times_a_second(lab):
    """0.2 rad/s of one joint is 11.459 degrees a second, and 20 messages of it turn the joint by 0.04 rad."""
    heard, sent = [], []
    hear, velocity = lab.server.driver.on_message, lab.arm._link._velocity
    say = velocity.publish
    lab.server.driver.on_message = lambda topic, message, now: (heard.append(message), hear(topic, message, now))
    velocity.publish = lambda message: (sent.append(lab.world.now_s), say(message))
    before = lab.server.driver.q.copy()
    dq = 0.2 * np.eye(7)[0]
    for i in range(20):
        lab.arm.servo(np.array(SPEC.home_q_rad) + 0.01 * i * dq, dq)
        lab.world.wait(0.01)
    lab.settle()
    np.testing.assert_allclose(np.diff(sent), 0.01, atol=1e-9)
    assert len(heard) == len(sent) == 20
    assert set(heard[0]) == {f"joint{number}" for number in range(1, 8)}
    assert heard[10]["joint1"] == pytest.approx(np.degrees(0.2), rel=0.05)
    lab.world.wait(0.02)
    assert lab.server.driver.q[0] - before[0] == pytest.approx(0.04, abs=0.006)
    assert len(lab.server.driver.buffer) <= 1


def test_small_messages_are_sent_one_by_one(lab):
    """Otherwise TCP gathers them, and the arm gets two every 20 ms."""
    assert lab.bridge.ros.factory._proto.transport.getTcpNoDelay()


def test_a_joint_that_passes_a_whole_turn_does_not_jump(lab):
    lab.server.driver.q[0] = 2 * np.pi - 0.02
    lab.world.wait(0.1)
    first = lab.arm.state().q_rad[0]
    lab.server.driver.q[0] = 2 * np.pi + 0.02
    lab.world.wait(0.04)
    assert lab.arm.state().q_rad[0] - first == pytest.approx(0.04, abs=0.015)


def test_a_driver_that_falls_silent_stops_the_arm_and_empties_its_buffer(lab):
    command = underway(lab)
    lab.server.driver.silent = True
    lab.world.wait(0.3)
    assert command.result.ending is Ending.FAULT
    assert "s old" in command.result.reason
    assert lab.server.driver.stopped
    q = lab.server.driver.q.copy()
    lab.world.wait(0.1)
    np.testing.assert_array_equal(lab.server.driver.q, q)
    lab.server.driver.silent = False
    lab.world.wait(0.1)
    assert finish(lab.arm.move(way(lab.station, 0.05)), lab.world).ending is Ending.DONE
    assert not lab.server.driver.stopped


def test_a_bridge_that_hangs_up_ends_the_motion_and_the_arm_stops_by_itself(lab):
    command = underway(lab)
    lab.server.disconnect()
    wait_for(lambda: not lab.bridge.ros.is_connected)
    lab.world.wait(0.1)
    assert command.result.ending is Ending.FAULT
    assert "is not connected" in command.result.reason
    with pytest.raises(HardwareError, match=r"rosbridge at 127\.0\.0\.1"):
        lab.arm.state()
    np.testing.assert_array_equal(lab.server.driver.dq, 0.0)


def test_a_stop_by_somebody_else_trips_a_guard(lab):
    """The driver says nothing of it: the arm just does not follow."""
    guard = Guard(lab.station, Kinematics(SPEC), GuardCfg(lag_rad=0.05))
    guard.station.arm.move(way(guard.station, 0.3))
    guard.station.world.wait(0.2)
    assert guard.reason == ""
    lab.server.driver.on_service("/j2s7s300_driver/in/stop")
    guard.station.world.wait(0.8)
    assert "from where it was told to be" in guard.reason


def test_an_object_between_the_fingers_is_held(lab):
    lab.server.driver.fingers.blocked_at = 3400.0
    assert finish(lab.gripper.move(0.01), lab.world).ending is Ending.HOLDING
    link = lab.gripper._link
    assert lab.gripper.state().opening_m == pytest.approx(link.opening_m(3400.0), abs=1e-3)
    assert link.turns(link.opening_m(3400.0)) == pytest.approx(3400.0)
    assert (link.turns(SPEC.gripper.opening_range_m[0]), link.turns(1.0)) == (6800.0, 0.0)


def test_nobody_at_the_address_is_one_sentence_and_nobody_is_called_again():
    with pytest.raises(HardwareError, match=r"no rosbridge answers at 127\.0\.0\.1:1:"):
        kinova.Rosbridge(kinova.KinovaCfg("127.0.0.1", 1, timeout_s=0.2))
    wait_for(lambda: not calls_due())
    assert not calls_due()


def test_a_lost_bridge_is_called_again_until_it_is_closed():
    server = RosbridgeServer(SPEC.home_q_rad, lambda: 0.0)
    bridge = kinova.Rosbridge(kinova.KinovaCfg("127.0.0.1", server.port))
    wait_for(lambda: server.clients)
    server.close()
    wait_for(calls_due)
    assert len(calls_due()) == 1
    bridge.close()
    wait_for(lambda: not calls_due())
    assert not calls_due()


def test_a_bridge_without_a_driver_is_told_from_a_missing_bridge():
    server = RosbridgeServer(SPEC.home_q_rad, lambda: 0.0)
    cfg = kinova.KinovaCfg("127.0.0.1", server.port, timeout_s=0.3)
    bridge = kinova.Rosbridge(kinova.KinovaCfg("127.0.0.1", server.port))
    with pytest.raises(
        HardwareError, match="no joint state comes on /j2s7s300_driver/out/joint_state; is kinova_driver"
    ):
        kinova.open_arm(SPEC, cfg, SteppedWorld(), bridge)
    bridge.close()
    server.close()
