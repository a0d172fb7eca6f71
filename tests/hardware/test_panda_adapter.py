"""Panda with its hand and a camera, through fakes of panda_py and pyrealsense2."""

import numpy as np
import pytest

from tests.hardware.contract import BackendContract, way
from tests.hardware.transports import panda as fake
from tests.hardware.transports.realsense import RecordedRealSense
from tests.hardware.transports.stepped import SteppedWorld
from tr_grasp.errors import HardwareError
from tr_grasp.hardware import Ending, Station, finish
from tr_grasp.hardware.adapters.panda import PandaCfg, PandaLink
from tr_grasp.hardware.adapters.panda_hand import PandaHandCfg, PandaHandLink
from tr_grasp.hardware.adapters.polled_gripper import PolledGripper
from tr_grasp.hardware.adapters.realsense import RealSense, RealSenseCfg
from tr_grasp.hardware.adapters.streamed_arm import StreamedArm
from tr_grasp.motion import MotionLimits
from tr_grasp.robots import robot_spec

SPEC = robot_spec("panda")
HOST = "here"


def panda():
    world = SteppedWorld()
    robot = fake.Panda(world, SPEC.home_q_rad)
    link = PandaLink(robot, fake.JointPosition, PandaCfg(HOST), world)
    return StreamedArm("panda", MotionLimits.of(SPEC), link, world), robot, world


def hand(world):
    device = fake.Gripper(world)
    link = PandaHandLink(device, SPEC.gripper, PandaHandCfg(HOST), world, device.submit)
    return PolledGripper(SPEC.gripper, link, world), device


@pytest.fixture
def recording(tmp_path):
    """Two pictures of 4 x 6 pixels: a wall at 0.5 m and, with a hole in it, at 0.6 m; counts of 0.1 mm."""
    depth = np.stack([np.full((4, 6), 5000), np.full((4, 6), 6000)]).astype(np.uint16)
    depth[1, 0, 0] = 0
    rgb = np.stack([np.full((4, 6, 3), 10), np.full((4, 6, 3), 20)]).astype(np.uint8)
    np.savez(tmp_path / "d415.npz", rgb=rgb, depth=depth, scale=1e-4, intrinsics=[616.0, 615.0, 2.4, 1.6])
    return tmp_path / "d415.npz"


def realsense(recording, world):
    rs = RecordedRealSense(recording, world)
    return RealSense(RealSenseCfg(width_px=6, height_px=4), world, rs), rs


class TestPanda(BackendContract):
    @pytest.fixture
    def station(self, recording):
        arm, _, world = panda()
        return Station(arm, hand(world)[0], world, realsense(recording, world)[0])


def test_closing_is_a_grasp_with_the_force_asked_for_and_opening_lets_go():
    _, _, world = panda()
    gripper, device = hand(world)
    device.fingers.blocked_at = 0.03
    assert finish(gripper.move(0.0, speed_mps=0.05, force_n=30.0), world).ending is Ending.HOLDING
    assert device.calls == [("grasp", 0.0, 0.05, 30.0)]
    state = gripper.state()
    assert (state.holding, state.opening_m, state.force_n) == (True, pytest.approx(0.03), 30.0)
    gripper.stop()
    world.wait(0.1)
    assert gripper.state().holding
    assert finish(gripper.move(0.08), world).ending is Ending.DONE
    assert not gripper.state().holding


def test_closing_on_nothing_ends_closed_without_a_fault():
    _, _, world = panda()
    gripper, _ = hand(world)
    assert finish(gripper.move(0.0), world).ending is Ending.DONE
    assert gripper.state().opening_m == pytest.approx(0.0, abs=1e-4)


def test_a_move_that_takes_over_leaves_no_fault():
    _, _, world = panda()
    gripper, _ = hand(world)
    first = gripper.move(0.0, speed_mps=0.02)
    world.wait(0.2)
    second = gripper.move(0.08)
    assert first.result.ending is Ending.SUPERSEDED
    assert finish(second, world).ending is Ending.DONE


def test_the_user_stop_ends_a_motion_and_afterwards_the_arm_stands_until_told():
    arm, robot, world = panda()
    station = Station(arm, hand(world)[0], world)
    command = arm.move(way(station, 0.3))
    world.wait(0.15)
    robot.pressed = True
    world.wait(0.05)
    assert command.result.ending is Ending.FAULT
    assert "user stop" in command.result.reason
    assert "user stop" in arm.state().fault
    assert arm.move(way(station, 0.1)).result.ending is Ending.FAULT
    robot.pressed = False
    world.wait(0.3)
    q = arm.state().q_rad
    world.wait(0.3)
    np.testing.assert_allclose(arm.state().q_rad, q, atol=1e-6)
    assert finish(arm.move(way(station, 0.1)), world).ending is Ending.DONE


def test_a_reflex_is_told_in_the_arms_words_and_recovered_from_with_the_next_command():
    arm, robot, world = panda()
    station = Station(arm, hand(world)[0], world)
    robot.mode, robot.error = fake.RobotMode.kReflex, "joint_reflex"
    world.wait(0.05)
    assert "reflex" in arm.state().fault
    robot.mode = fake.RobotMode.kIdle
    world.wait(0.05)
    assert finish(arm.move(way(station, 0.05)), world).ending is Ending.DONE


def test_a_pulled_cable_is_a_fault_at_once_and_soon_no_connection():
    arm, robot, world = panda()
    command = arm.move(way(Station(arm, hand(world)[0], world), 0.3))
    world.wait(0.1)
    robot.lost = True
    world.wait(0.05)
    assert command.result.ending is Ending.FAULT
    assert "UDP receive" in command.result.reason
    world.wait(1.2)
    with pytest.raises(HardwareError, match="'panda' is not connected: nothing has come for 1"):
        arm.state()


def test_a_picture_is_in_metres_with_holes_where_nothing_was_measured(recording):
    world = SteppedWorld()
    camera, _ = realsense(recording, world)
    np.testing.assert_allclose(camera.capture().depth_m, 0.5, atol=1e-6)
    world.wait(0.05)
    image = camera.capture()
    assert np.isnan(image.depth_m[0, 0])
    np.testing.assert_allclose(image.depth_m[1:], 0.6, atol=1e-6)
    assert (image.rgb == 20).all()
    assert (image.intrinsics.fx, image.intrinsics.cy) == (616.0, 1.6)
    assert image.stamp_s == pytest.approx(1 / 30, abs=0.02)


def test_a_camera_that_falls_silent_or_is_unplugged_gives_no_old_pictures(recording):
    world = SteppedWorld()
    camera, rs = realsense(recording, world)
    rs.frozen = True
    world.wait(0.7)
    with pytest.raises(HardwareError, match=r"no picture for 0\.7"):
        camera.capture()
    rs.frozen, rs.plugged = False, False
    world.wait(0.1)
    with pytest.raises(HardwareError, match="not connected"):
        camera.capture()
    rs.plugged = True
    world.wait(0.1)
    assert camera.capture().depth_m.shape == (4, 6)
    camera.close()
    assert rs.stopped


def test_a_camera_that_is_not_there_or_cannot_do_the_size_is_named(recording):
    world = SteppedWorld()
    rs = RecordedRealSense(recording, world)
    rs.plugged = False
    with pytest.raises(HardwareError, match="no RealSense 815 camera gives pictures: No device connected"):
        RealSense(RealSenseCfg(serial="815", width_px=6, height_px=4), world, rs)
    with pytest.raises(HardwareError, match="resolve"):
        RealSense(RealSenseCfg(width_px=1, height_px=4), world, RecordedRealSense(recording, world))
