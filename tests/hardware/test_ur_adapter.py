"""UR5 with either of its grippers, through fakes of what they speak."""

import numpy as np
import pytest

from tests.hardware.contract import BackendContract, way
from tests.hardware.transports import rtde, urcap
from tests.hardware.transports.stepped import SteppedWorld
from tr_grasp.errors import HardwareError
from tr_grasp.hardware import Ending, GripperState, Guard, GuardCfg, KinematicFake, Station, finish
from tr_grasp.hardware.adapters import rg2, robotiq
from tr_grasp.hardware.adapters.streamed_arm import StreamedArm
from tr_grasp.hardware.adapters.ur import UrCfg, UrLink
from tr_grasp.motion import Kinematics, MotionLimits
from tr_grasp.robots import robot_spec

NOWHERE = "127.0.0.1"


def ur5(robot="ur5_robotiq_2f85", world=None):
    """The arm and its box."""
    spec, world = robot_spec(robot), world or SteppedWorld()
    box = rtde.Controller(world, spec.home_q_rad)
    link = UrLink(rtde.RTDEControlInterface(box), rtde.RTDEReceiveInterface(box), UrCfg(NOWHERE), world)
    return StreamedArm(spec.name, MotionLimits.of(spec), link, world), box, world


@pytest.fixture
def fingers():
    """Makes a gripper and its fake; both are closed afterwards."""
    made = []

    def make(name, world):
        spec = robot_spec(f"ur5_{name}").gripper
        module, fake = (robotiq, urcap.Robotiq(world)) if name == "robotiq_2f85" else (rg2, urcap.Rg2(world))
        cfg = (robotiq.RobotiqCfg if module is robotiq else rg2.Rg2Cfg)(NOWHERE, fake.port)
        made.append(fake)
        made.append(module.open_gripper(spec, cfg, world))
        return made[-1], fake

    yield make
    for thing in reversed(made):
        thing.close()


class TestUrRobotiq(BackendContract):
    @pytest.fixture
    def station(self, fingers):
        arm, _, world = ur5("ur5_robotiq_2f85")
        return Station(arm, fingers("robotiq_2f85", world)[0], world)


class TestUrRg2(BackendContract):
    @pytest.fixture
    def station(self, fingers):
        arm, _, world = ur5("ur5_rg2")
        return Station(arm, fingers("rg2", world)[0], world)


def moving(robot="ur5_robotiq_2f85", gripper=None):
    """An arm in the middle of a motion."""
    arm, box, world = ur5(robot)
    station = Station(arm, gripper or KinematicFake.of(robot_spec(robot)).gripper, world)
    command = arm.move(way(station, 0.4).slower(2.0))
    world.wait(0.3)
    assert np.abs(arm.state().dq_rad_s).max() > 0.1
    return station, box, command


def fail(box, how):
    if how == "network":
        box.connected = False
    elif how == "frozen":
        box.frozen = True
    elif how == "program":
        box.program = False
    else:
        setattr(box, how, True)


def mend(box):
    box.connected, box.frozen, box.emergency, box.protective = True, False, False, False


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ("emergency", "emergency stop"),
        ("protective", "protective stop"),
        ("network", "at 127.0.0.1 is not connected"),
        ("frozen", "its state is 0.1"),
        ("program", "its control program has ended"),
    ],
)
def test_a_failure_in_motion_stops_the_arm_with_the_reason_and_it_stands_until_told(how, words):
    station, box, command = moving()
    arm, world = station.arm, station.world
    fail(box, how)
    world.wait(0.2)
    assert command.result.ending is Ending.FAULT
    assert words in command.result.reason
    world.wait(0.5)
    np.testing.assert_allclose(box.dq, 0.0, atol=1e-3)
    if how != "program":
        again = arm.move(way(station, 0.1))
        assert again.result.ending is Ending.FAULT
        mend(box)
        world.wait(0.1)
    q = box.q.copy()
    world.wait(0.4)
    np.testing.assert_allclose(box.q, q, atol=1e-6)
    assert finish(arm.move(way(station, 0.1)), world).ending is Ending.DONE
    assert np.abs(box.q - q).max() > 0.05


def test_without_a_connection_there_is_no_state():
    station, box, _ = moving()
    box.connected = False
    station.world.wait(0.1)
    with pytest.raises(HardwareError, match="not connected"):
        station.arm.state()


def test_a_guard_before_the_arm_trips_on_what_the_controller_reports():
    arm, box, world = ur5()
    spec = robot_spec("ur5_robotiq_2f85")

    class Still:
        """A gripper whose state is always fresh."""

        def __init__(self):
            self.__dict__ |= {name: getattr(spec.gripper, name) for name in ("opening_range_m", "force_range_n")}
            self.speed_range_mps = spec.gripper.speed_range_mps

        def state(self):
            return GripperState(world.now_s, 0.085)

        def stop(self):
            pass

    guard = Guard(Station(arm, Still(), world), Kinematics(spec), GuardCfg(stale_after_s=0.1))
    command = guard.station.arm.move(way(guard.station, 0.3))
    guard.station.world.wait(0.2)
    assert guard.reason == ""
    box.emergency = True
    guard.station.world.wait(0.1)
    assert "the arm reports a fault: emergency stop" in guard.reason
    assert command.result.ending is Ending.FAULT
    box.emergency = False
    guard.station.world.wait(0.3)
    assert guard.reset() == ""
    too_fast = guard.station.arm.servo(arm.commanded().q, 2 * arm.limits.velocity_rad_s)
    assert too_fast.result.ending is Ending.REFUSED
    sent = len(box.sent)
    guard.station.world.wait(0.2)
    assert np.ptp(np.stack([q for _, q in box.sent[sent:]]), axis=0).max() < 1e-9 if len(box.sent) > sent else True


def test_set_points_come_125_times_a_second_in_radians_and_are_followed():
    arm, box, world = ur5()
    trajectory = way(Station(arm, None, world), 0.3)
    arm.move(trajectory)
    begun = world.now_s
    world.wait(trajectory.duration_s)
    sent = [(t, q) for t, q in box.sent if t > begun]
    np.testing.assert_allclose(np.diff([t for t, _ in sent]), 0.008, atol=1e-9)
    for t, q in sent[:: len(sent) // 8]:
        np.testing.assert_allclose(q, trajectory.sample(min(t - begun + 0.008, trajectory.duration_s)).q, atol=1e-6)


def test_when_our_process_dies_the_watchdog_ends_the_program():
    station, box, _ = moving()
    station.arm._end_beats()
    station.world.wait(0.5)
    assert not box.program
    np.testing.assert_allclose(box.dq, 0.0, atol=1e-3)


def test_a_controller_in_emergency_stop_is_not_opened():
    world, spec = SteppedWorld(), robot_spec("ur5_rg2")
    box = rtde.Controller(world, spec.home_q_rad)
    box.emergency = True
    link = UrLink(rtde.RTDEControlInterface(box), rtde.RTDEReceiveInterface(box), UrCfg(NOWHERE), world)
    with pytest.raises(HardwareError, match="reports a fault: emergency stop"):
        StreamedArm(spec.name, MotionLimits.of(spec), link, world)


def test_closing_halts_the_arm_and_lets_go():
    station, box, command = moving()
    station.arm.close()
    assert command.result.ending is Ending.STOPPED
    assert not box.connected
    assert not box.program


# ---- grippers ------------------------------------------------------------------------------------------------


def test_openings_speeds_and_forces_are_counts_of_their_ranges(fingers):
    """34 of 85 mm is 0.6 of the way from 3 to 230; 46 mm/s is 0.2 of 20 to 150, 106 N 0.4 of 20 to 235."""
    world = SteppedWorld()
    gripper, fake = fingers("robotiq_2f85", world)
    gripper.move(0.034, speed_mps=0.046, force_n=106.0)
    assert "SET POS 139 SPE 51 FOR 102 GTO 1" in fake.said


@pytest.mark.parametrize("name", ["robotiq_2f85", "rg2"])
def test_an_object_between_the_fingers_is_held_with_the_force_asked_for(fingers, name):
    world = SteppedWorld()
    gripper, fake = fingers(name, world)
    fake.fingers.blocked_at = 123 if name == "robotiq_2f85" else 40.0
    expected = 0.04007 if name == "robotiq_2f85" else 0.040
    result = finish(gripper.move(0.0, force_n=30.0), world)
    assert result.ending is Ending.HOLDING
    state = gripper.state()
    assert (state.opening_m, state.force_n) == (pytest.approx(expected, abs=1e-4), 30.0)
    gripper.stop()
    world.wait(0.2)
    assert gripper.state().holding
    assert finish(gripper.move(0.08), world).ending is Ending.DONE


def test_a_robotiq_in_an_emergency_stop_or_cut_off_or_faulty_says_so(fingers):
    world = SteppedWorld()
    gripper, fake = fingers("robotiq_2f85", world)
    fake.fault = 14
    world.wait(0.1)
    assert gripper.state().fault == "overcurrent"
    assert gripper.move(0.02).result.ending is Ending.FAULT
    fake.fault = 0
    world.wait(0.1)
    command = gripper.move(0.0, speed_mps=0.02)
    world.wait(0.2)
    fake.emergency = True
    world.wait(0.1)
    assert command.result.ending is Ending.FAULT
    with pytest.raises(HardwareError, match="does not tell FLT, it answers 'FLT \\?'; is the arm stopped"):
        gripper.state()
    fake.emergency = False
    fake.disconnect()
    world.wait(0.1)
    with pytest.raises(HardwareError, match="not connected"):
        gripper.state()


def test_a_robotiq_that_is_not_activated_is_not_activated_by_us(fingers):
    fake = urcap.Robotiq(SteppedWorld())
    fake.status = 0
    with pytest.raises(HardwareError, match="not activated; activate it on the teach pendant"):
        robotiq.open_gripper(
            robot_spec("ur5_robotiq_2f85").gripper, robotiq.RobotiqCfg(NOWHERE, fake.port), SteppedWorld()
        )
    assert not any(line.startswith("SET") for line in fake.said)
    fake.close()


def test_an_rg2_whose_safety_switch_is_pressed_stops_and_says_so(fingers):
    world = SteppedWorld()
    gripper, fake = fingers("rg2", world)
    command = gripper.move(0.0, speed_mps=0.04)
    world.wait(0.2)
    fake.safety = True
    world.wait(0.1)
    assert command.result.ending is Ending.FAULT
    assert "safety switch" in command.result.reason
    width = fake.fingers.position
    world.wait(0.3)
    assert fake.fingers.position == pytest.approx(width)
