import numpy as np
import pytest

from tr_grasp.errors import ConfigError, MotionError
from tr_grasp.hardware import Ending, Fault, Guard, GuardCfg, KinematicFake, finish
from tr_grasp.motion import Kinematics, Trajectory, time_optimal
from tr_grasp.robots import robot_spec

SPEC = robot_spec("ur5_rg2")
ARM = Kinematics(SPEC)
HOME = np.array(SPEC.home_q_rad)
STILL = np.zeros(6)


def guarded(cfg=None, **fake):
    raw = KinematicFake.of(SPEC, **fake)
    return Guard(raw, ARM, cfg), raw


def line(q, goal, limits):
    return time_optimal(np.stack([q, goal]), limits).trajectory


def turned(pan_rad):
    """Home with the first joint turned."""
    return HOME + pan_rad * np.eye(6)[0]


def assert_tripped(guard, raw, command, words):
    """Refused with a reason; nothing moves, neither for this command nor for any other, until reset."""
    assert command.result.ending is Ending.REFUSED
    assert words in command.result.reason
    assert words in guard.reason
    before = raw.arm.state().q_rad
    arm, gripper, world = guard.station.arm, guard.station.gripper, guard.station.world
    for again in (arm.move(Trajectory.resting(arm.commanded().q)), arm.servo(arm.commanded().q, STILL)):
        assert again.result.ending is Ending.REFUSED
        assert "reset()" in again.result.reason
    assert gripper.move(0.02).result.ending is Ending.REFUSED
    world.wait(0.3)
    np.testing.assert_allclose(raw.arm.state().q_rad, before, atol=1e-9)
    assert guard.reset() == ""
    assert finish(arm.move(line(arm.commanded().q, HOME - 0.02, guard.limits)), world).ending is Ending.DONE


def test_a_trajectory_into_the_joint_margin_is_refused():
    guard, raw = guarded(GuardCfg(joint_margin_rad=1.0))
    goal = HOME.copy()
    goal[2] = SPEC.upper_rad[2] - 0.5
    assert_tripped(guard, raw, guard.station.arm.move(line(HOME, goal, raw.arm.limits)), "joint 2 reaches position")


def test_a_trajectory_faster_than_the_share_is_refused():
    guard, raw = guarded(GuardCfg(speed_share=0.2))
    assert_tripped(guard, raw, guard.station.arm.move(line(HOME, HOME + 0.8, raw.arm.limits)), "reaches velocity")


def test_a_trajectory_that_leaves_the_workspace_is_refused_even_if_it_comes_back():
    p = ARM.pose(HOME)[:3, 3]
    guard, raw = guarded(GuardCfg(workspace_m=(tuple(p - 0.1), tuple(p + 0.1))))
    there_and_back = time_optimal(np.stack([HOME, turned(0.6), HOME]), raw.arm.limits).trajectory
    assert_tripped(guard, raw, guard.station.arm.move(there_and_back), "leave the workspace by")


def test_a_jump_at_the_start_of_a_trajectory_is_refused():
    guard, raw = guarded()
    assert_tripped(guard, raw, guard.station.arm.move(line(HOME + 0.1, HOME + 0.2, raw.arm.limits)), "jumps by")


@pytest.mark.parametrize(
    ("q", "dq", "words"),
    [
        (HOME + 0.1, STILL, "jumps by 0.1 rad"),
        (np.where(np.arange(6) == 2, 4.0, HOME), STILL, "outside the joint limits"),
        (HOME, np.full(6, 4.0), "above the limits"),
        (HOME, np.array([-3.0, 0, 0, 0, 0, 0]), "leave the workspace"),
    ],
)
def test_set_points_that_break_a_rule_are_refused(q, dq, words):
    p = ARM.pose(HOME)[:3, 3]
    guard, raw = guarded(GuardCfg(workspace_m=(tuple(p - 0.1), tuple(p + 0.1))))
    assert_tripped(guard, raw, guard.station.arm.servo(q, dq), words)


def test_small_steps_in_too_little_time_are_refused():
    """Each is less than a jump, together they are faster than the arm."""
    guard, raw = guarded()
    for i in range(2):
        command = guard.station.arm.servo(HOME + 0.04 * i, STILL)
        if not i:
            guard.station.world.wait(0.005)
    assert_tripped(guard, raw, command, "more than the speed limits")


def test_a_stream_that_keeps_the_rules_passes():
    guard, _ = guarded()
    arm, world = guard.station.arm, guard.station.world
    for i in range(100):
        command = arm.servo(HOME + 0.3 * 0.01 * i, np.full(6, 0.3))
        assert not command.done
        world.wait(0.01)
    assert guard.reason == ""


def test_a_stream_that_falls_silent_trips_the_watchdog():
    guard, raw = guarded(GuardCfg(watchdog_s=0.05))
    command = guard.station.arm.servo(HOME, np.full(6, 0.1))
    guard.station.world.wait(0.04)
    assert guard.reason == ""
    guard.station.world.wait(0.1)
    assert "no set-point for 0.06 s" in guard.reason
    assert command.result.ending is Ending.STOPPED
    assert_tripped(guard, raw, guard.station.arm.servo(HOME, STILL), "no set-point")


def test_thinking_longer_than_the_watchdog_trips_it_too():
    guard, _ = guarded(GuardCfg(watchdog_s=0.05))
    guard.station.arm.servo(HOME, STILL)
    guard.station.world.charge(0.2)
    assert "no set-point" in guard.reason


@pytest.mark.parametrize(
    ("fault", "words"),
    [("stale", "the arm's state is"), ("disconnected", "not connected"), ("emergency_stop", "emergency stop")],
)
def test_faults_trip_the_guard_and_it_stays_so_until_they_are_over_and_it_is_reset(fault, words):
    guard, raw = guarded(faults=[Fault(fault, 0.2, 1.0)])
    arm, world = guard.station.arm, guard.station.world
    command = arm.move(line(HOME, HOME + 0.5, raw.arm.limits).slower(3.0))
    world.wait(0.1)
    assert guard.reason == ""
    world.wait(0.4)
    assert words in guard.reason
    assert command.result.ending in (Ending.STOPPED, Ending.FAULT)
    assert words in guard.reset()
    assert arm.move(Trajectory.resting(HOME)).result.ending is Ending.REFUSED
    world.wait(0.6)
    assert words in guard.reason
    assert guard.reset() == ""
    assert not arm.move(line(arm.commanded().q, HOME, raw.arm.limits)).done


def test_too_much_torque_trips_the_guard():
    guard, raw = guarded(GuardCfg(effort_share=0.5))
    raw.arm.external_effort_nm[:] = [0, 0, 0, 13.9, 0, 0]
    guard.station.world.wait(0.05)
    assert guard.reason == ""
    raw.arm.external_effort_nm[3] = 14.1
    guard.station.world.wait(0.05)
    assert "joint 3 needs 14.1 N m" in guard.reason


def test_a_grip_that_is_too_strong_is_refused():
    guard, raw = guarded(GuardCfg(grip_force_n=10.0))
    assert guard.station.gripper.force_range_n == (3.0, 10.0)
    assert_tripped(guard, raw, guard.station.gripper.move(0.05, force_n=20.0), "force_n must be up to 10")


def test_an_arm_that_does_not_follow_trips_the_guard():
    guard, raw = guarded(GuardCfg(lag_rad=0.05), lag_s=0.3)
    guard.station.arm.move(line(HOME, HOME + 0.8, raw.arm.limits))
    guard.station.world.wait(1.0)
    assert "from where it was told to be" in guard.reason


def test_an_arm_that_is_outside_the_workspace_may_come_back_but_not_go_further():
    p = ARM.pose(HOME)[:3, 3]
    low, high = p - np.array([0.1, 0.3, 0.1]), p + np.array([0.1, -0.05, 0.1])
    guard, raw = guarded(GuardCfg(workspace_m=(tuple(low), tuple(high))))
    out, back = sorted((turned(0.2), turned(-0.2)), key=lambda q: -ARM.pose(q)[1, 3])
    assert "50 mm outside the workspace" in guard.check()
    assert guard.reset() == ""
    assert guard.station.arm.move(line(HOME, out, raw.arm.limits)).result.ending is Ending.REFUSED
    assert guard.reset() == ""
    assert finish(guard.station.arm.move(line(HOME, back, raw.arm.limits)), guard.station.world).ending is Ending.DONE


def test_what_comes_too_late_is_refused_but_trips_nothing():
    """A planner that was slow this time goes on with the motion that it has."""
    guard, raw = guarded()
    arm, world = guard.station.arm, guard.station.world
    world.wait(0.1)
    assert arm.move(line(HOME, HOME + 0.1, raw.arm.limits), at_s=0.05).result.ending is Ending.REFUSED
    assert guard.reason == ""
    assert not arm.move(line(HOME, HOME + 0.1, raw.arm.limits)).done


def test_another_number_of_joints_raises_and_trips_nothing():
    guard, _ = guarded()
    with pytest.raises(MotionError, match="6 joints"):
        guard.station.arm.move(Trajectory.resting(np.zeros(7)))
    with pytest.raises(MotionError, match="finite"):
        guard.station.arm.servo(HOME * np.nan, STILL)
    assert guard.reason == ""


@pytest.mark.parametrize(
    "setting", [{"watchdog_s": 0.0}, {"joint_margin_rad": -0.1}, {"workspace_m": ((0, 0, 0), (1, 0, 1))}]
)
def test_rules_that_make_no_sense_are_refused(setting):
    with pytest.raises(ConfigError, match=next(iter(setting))):
        GuardCfg(**setting)
