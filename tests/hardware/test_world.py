"""Time, tracked things, faults: what planning in a moving world stands on."""

import numpy as np
import pytest

from tr_grasp.errors import ConfigError, HardwareError, MotionError
from tr_grasp.hardware import (
    Ending,
    Fault,
    KinematicFake,
    PoseStream,
    PoseStreamCfg,
    ScriptedObject,
    finish,
    thinking,
)
from tr_grasp.motion import JointState, point_to_point, time_optimal
from tr_grasp.robots import robot_spec

SPEC = robot_spec("ur5_rg2")
HOME = np.array(SPEC.home_q_rad)


def along_y(times):
    """3 cm/s."""
    T = np.tile(np.eye(4), (len(times), 1, 1))
    T[:, 0, 3], T[:, 1, 3] = 0.5, -0.2 + 0.03 * times
    return T


def test_a_moving_thing_is_seen_at_the_rate_and_as_late_as_the_stream_says():
    thing = ScriptedObject("can", along_y, PoseStreamCfg(rate_hz=20, latency_s=0.12))
    world = KinematicFake.of(SPEC, objects=[thing]).world
    world.wait(1.0)
    readings = world.poses("can")
    stamps = np.array([reading.stamp_s for reading in readings])
    np.testing.assert_allclose(np.diff(stamps), 0.05, atol=1e-9)
    assert stamps[-1] == pytest.approx(0.85)
    np.testing.assert_allclose([r.T_base_object[1, 3] for r in readings], -0.2 + 0.03 * stamps, atol=1e-12)
    assert [r.stamp_s for r in world.poses("can", after_s=0.72)] == pytest.approx([0.75, 0.8, 0.85])


def test_noise_and_drop_outs_are_as_large_as_the_settings_and_the_same_again():
    cfg = PoseStreamCfg(rate_hz=100, noise_m=0.002, noise_rad=0.01, dropout_share=0.25, seed=3)
    streams = PoseStream(cfg), PoseStream(cfg)
    for k in range(1500):
        for stream in streams:
            stream.observe(k / 100, np.eye(4))
    first, second = (stream.arrived(100.0) for stream in streams)
    assert len(first) == pytest.approx(0.75 * 1500, abs=60)
    offsets = np.array([reading.T_base_object[:3, 3] for reading in first])
    np.testing.assert_allclose(offsets.std(axis=0), 0.002, rtol=0.1)
    np.testing.assert_array_equal(offsets, [reading.T_base_object[:3, 3] for reading in second])
    R = np.array([reading.T_base_object[:3, :3] for reading in first])
    np.testing.assert_allclose(R @ R.swapaxes(1, 2), np.tile(np.eye(3), (len(R), 1, 1)), atol=1e-9)
    np.testing.assert_allclose(R[:, 1, 0].std(), 0.01, rtol=0.15)


def test_a_thing_that_cannot_be_seen_has_no_new_readings():
    hidden = ScriptedObject("can", lambda times: along_y(times) if times[0] < 0.5 else None)
    world = KinematicFake.of(SPEC, objects=[hidden]).world
    world.wait(1.0)
    assert world.poses("can")
    assert world.poses("can", after_s=0.5) == ()


@pytest.mark.parametrize("setting", [{"rate_hz": 0.0}, {"latency_s": -0.1}, {"dropout_share": 1.5}])
def test_streams_that_make_no_sense_are_refused(setting):
    with pytest.raises(ConfigError, match=next(iter(setting))):
        PoseStreamCfg(**setting)


def test_thinking_costs_the_world_what_it_took_or_what_is_agreed():
    world = KinematicFake.of(SPEC).world
    with thinking(world, fixed_s=0.475) as thought:
        assert world.now_s == 0.0
    assert (thought.seconds, world.now_s) == (0.475, pytest.approx(0.475))
    with thinking(world) as thought:
        sum(range(200_000))
    assert thought.seconds > 0
    assert world.now_s == pytest.approx(0.475 + thought.seconds, abs=world.tick_s)


def test_replanning_at_25_hz_towards_a_moving_thing_keeps_the_arm_moving_without_a_seam():
    """The loop of a dynamic grasp: look, think on charge, plan from where the arm will be, send it in time."""
    cfg = PoseStreamCfg(rate_hz=30, latency_s=0.05)
    station = KinematicFake.of(SPEC, objects=[ScriptedObject("can", along_y, cfg)])
    arm, world, plans, speeds = station.arm, station.world, [], []
    while world.now_s < 2.0:
        starts_s = world.now_s + 0.04
        with thinking(world, fixed_s=0.03):
            seen = world.poses("can")
            y = seen[-1].T_base_object[1, 3] if seen else -0.2
            start = arm.commanded(starts_s)
            goal = JointState.at_rest(HOME + np.array([1.0 + y, 0.1, 0, 0, 0, 0]))
            plan = point_to_point(start, goal, arm.limits).trajectory
        plans.append(arm.move(plan, at_s=starts_s))
        world.wait(max(0.0, starts_s - world.now_s))
        speeds.append(arm.state().dq_rad_s[0])
    assert all(plan.result is None or plan.result.ending is Ending.SUPERSEDED for plan in plans)
    assert len(plans) == pytest.approx(50, abs=2)
    assert np.abs(np.diff(speeds)).max() < arm.limits.acceleration_rad_s2[0] * 0.05
    assert min(speeds[5:12]) > 1.0


def test_fingers_stop_at_what_is_between_them_and_let_go():
    station = KinematicFake.of(SPEC, blocked_at_m=0.04)
    result = finish(station.gripper.move(0.0, force_n=20.0), station.world)
    assert result.ending is Ending.HOLDING
    assert result.succeeded
    state = station.gripper.state()
    assert (state.holding, state.opening_m, state.force_n) == (True, pytest.approx(0.04), 20.0)
    station.gripper.stop()
    station.world.wait(0.1)
    assert station.gripper.state().holding
    assert finish(station.gripper.move(0.1), station.world).ending is Ending.DONE
    assert not station.gripper.state().holding


def test_a_lagging_arm_is_behind_by_speed_times_its_time_constant():
    station = KinematicFake.of(SPEC, lag_s=0.05)
    for i in range(100):
        station.arm.servo(HOME + 0.5 * 0.01 * i, np.full(6, 0.5))
        station.world.wait(0.01)
    behind = station.arm.commanded().q - station.arm.state().q_rad
    np.testing.assert_allclose(behind, 0.5 * 0.05, rtol=0.1)


def move_into(fault):
    station = KinematicFake.of(SPEC, faults=[Fault(fault, 0.2, 1.0)])
    command = station.arm.move(time_optimal(np.stack([HOME, HOME + 1.0]), station.arm.limits).trajectory)
    station.world.wait(0.5)
    return station, command


@pytest.mark.parametrize("fault", ["disconnected", "emergency_stop"])
def test_a_fault_ends_the_motion_refuses_others_and_afterwards_the_arm_stands_still_until_told(fault):
    station, command = move_into(fault)
    assert command.result.ending is Ending.FAULT
    again = station.arm.move(time_optimal(np.stack([HOME, HOME + 0.1]), station.arm.limits).trajectory)
    assert again.result.ending is Ending.FAULT
    assert station.gripper.move(0.02).result.ending is Ending.FAULT
    station.world.wait(0.6)
    q = station.arm.state().q_rad
    station.world.wait(0.3)
    np.testing.assert_array_equal(station.arm.state().q_rad, q)
    assert not station.arm.move(time_optimal(np.stack([q, HOME]), station.arm.limits).trajectory).done


def test_of_what_is_not_connected_there_is_no_state():
    station, _ = move_into("disconnected")
    for read in (station.arm.state, station.gripper.state, station.camera.capture):
        with pytest.raises(HardwareError, match="not connected"):
            read()


def test_stale_states_keep_their_stamp_while_time_goes_on():
    station, command = move_into("stale")
    assert station.arm.state().stamp_s == pytest.approx(0.195)
    assert not command.done
    assert station.arm.state().fault == ""


def test_a_camera_sees_the_table_where_it_is():
    station = KinematicFake.of(SPEC)
    image = station.camera.capture()
    points = station.camera.camera.deproject(image.depth_m)
    np.testing.assert_allclose(points[..., 2], 0.0, atol=1e-5)


def test_a_command_that_never_ends_is_cancelled():
    station = KinematicFake.of(SPEC)
    slow = time_optimal(np.stack([HOME, HOME + 0.5]), station.arm.limits).trajectory.slower(20.0)
    assert finish(station.arm.move(slow), station.world, limit_s=0.5).ending is Ending.CANCELLED
    with pytest.raises(MotionError, match="limit_s"):
        finish(station.arm.move(slow), station.world, limit_s=-1.0)
