"""What every backend of the hardware protocols must do. Subclass it, give the fixture, and it is tested:

    class TestMyArm(BackendContract):
        @pytest.fixture
        def station(self): ...

The arm is at rest, far from its limits and from anything that it could touch; the gripper is open and empty.
"""

from __future__ import annotations

import numpy as np
import pytest

from tr_grasp.errors import MotionError
from tr_grasp.hardware import Arm, Ending, Gripper, RGBDCamera, Station, World, finish
from tr_grasp.motion import JointState, Trajectory, point_to_point, time_optimal


class BackendContract:
    """Tests of a station."""

    close_rad = 0.01
    """How near the measured joints are to the commanded ones after a motion."""
    close_m = 0.001
    """How near the measured opening is to the one asked for."""

    @pytest.fixture
    def station(self) -> Station:
        """A fresh one; subclasses give it."""
        raise NotImplementedError

    # ---- the clock ---------------------------------------------------------------------------------------------

    def test_everything_has_what_the_protocols_name(self, station):
        assert isinstance(station.arm, Arm)
        assert isinstance(station.gripper, Gripper)
        assert isinstance(station.world, World)
        assert station.camera is None or isinstance(station.camera, RGBDCamera)

    def test_waiting_lets_time_pass_and_short_waits_add_up(self, station):
        begun = station.world.now_s
        for _ in range(50):
            station.world.wait(0.001)
        station.world.wait(0.05)
        assert station.world.now_s - begun == pytest.approx(0.1, abs=0.01)

    def test_time_does_not_go_backwards(self, station):
        for duration in (-0.1, float("nan")):
            with pytest.raises(MotionError, match="duration_s"):
                station.world.wait(duration)

    def test_states_are_stamped_by_the_worlds_clock(self, station):
        station.world.wait(0.1)
        for state in (station.arm.state(), station.gripper.state()):
            assert 0 <= station.world.now_s - state.stamp_s < 0.05
            assert state.fault == ""

    def test_the_poses_of_something_unknown_name_what_is_known(self, station):
        with pytest.raises(MotionError, match="unknown object 'nothing'"):
            station.world.poses("nothing")

    # ---- trajectories ------------------------------------------------------------------------------------------

    def test_a_trajectory_is_followed_to_its_end(self, station):
        trajectory = way(station, 0.2)
        command = station.arm.move(trajectory)
        assert not command.done
        assert finish(command, station.world).ending is Ending.DONE
        assert command.progress == 1.0
        station.world.wait(0.3)
        state = station.arm.state()
        np.testing.assert_allclose(state.q_rad, trajectory.end.q, atol=self.close_rad)
        np.testing.assert_allclose(state.dq_rad_s, 0.0, atol=0.02)

    def test_progress_grows_and_half_way_the_arm_is_under_way(self, station):
        trajectory = way(station, 0.2)
        command = station.arm.move(trajectory)
        seen = []
        while not command.done:
            seen.append(command.progress)
            station.world.wait(trajectory.duration_s / 10)
        assert seen == sorted(seen)
        assert 0.3 < seen[len(seen) // 2] < 0.7

    def test_the_arm_knows_what_it_is_commanded_to_do_later(self, station):
        trajectory, begun = way(station, 0.2), station.world.now_s
        station.arm.move(trajectory)
        station.world.wait(0.05)
        for share in (0.5, 0.9, 1.5):
            expected = trajectory.sample(share * trajectory.duration_s)
            told = station.arm.commanded(begun + share * trajectory.duration_s)
            np.testing.assert_allclose(told.q, expected.q, atol=1e-6)
            np.testing.assert_allclose(told.dq, expected.dq, atol=1e-6)

    def test_a_new_trajectory_takes_over_on_time_and_without_a_seam(self, station):
        """As a planner does that plans while the arm moves."""
        arm, world = station.arm, station.world
        first = arm.move(way(station, 0.4))
        world.wait(0.1)
        joins_s = world.now_s + 0.08
        start = arm.commanded(joins_s)
        goal = JointState.at_rest(start.q - 0.1)
        second = arm.move(point_to_point(start, goal, arm.limits).trajectory, at_s=joins_s)
        assert not first.done
        assert not second.done
        world.wait(0.05)
        assert not first.done
        fastest, before = arm.limits.velocity_rad_s, arm.state()
        while not second.done:
            world.wait(0.01)
            now = arm.state()
            assert (np.abs(now.q_rad - before.q_rad) <= fastest * 0.02 + 0.01).all()
            before = now
        assert first.result.ending is Ending.SUPERSEDED
        assert second.result.ending is Ending.DONE
        world.wait(0.3)
        np.testing.assert_allclose(arm.state().q_rad, goal.q, atol=self.close_rad)

    def test_a_trajectory_that_comes_too_late_is_refused_and_what_goes_on_goes_on(self, station):
        arm, world = station.arm, station.world
        first = arm.move(way(station, 0.2))
        start, late_s = arm.commanded(world.now_s + 0.02), world.now_s + 0.02
        world.wait(0.1)
        second = arm.move(point_to_point(start, JointState.at_rest(start.q), arm.limits).trajectory, at_s=late_s)
        assert second.result.ending is Ending.REFUSED
        assert "ago" in second.result.reason
        assert finish(first, world).ending is Ending.DONE

    def test_a_trajectory_that_starts_elsewhere_is_refused_and_nothing_moves(self, station):
        q = station.arm.commanded().q
        self.refused(station, Trajectory([0.0, 1.0], [q + 0.02, q + 0.2], np.zeros((2, len(q)))), "starts")

    def test_a_trajectory_beyond_the_limits_is_refused_and_nothing_moves(self, station):
        q = station.arm.commanded().q
        limits = station.arm.limits
        fast = Trajectory([0.0, 0.3 / limits.velocity_rad_s.max()], [q, q + 0.3], np.zeros((2, len(q))))
        self.refused(station, fast, "is allowed")

    def refused(self, station, trajectory, words):
        before = station.arm.state().q_rad
        command = station.arm.move(trajectory)
        assert command.result.ending is Ending.REFUSED
        assert words in command.result.reason
        station.world.wait(0.2)
        np.testing.assert_allclose(station.arm.state().q_rad, before, atol=1e-3)

    def test_another_number_of_joints_raises(self, station):
        with pytest.raises(MotionError, match="joints"):
            station.arm.move(Trajectory.resting(np.zeros(3)))
        with pytest.raises(MotionError, match="joints"):
            station.arm.servo(np.zeros(3), np.zeros(3))

    # ---- stopping ----------------------------------------------------------------------------------------------

    @pytest.mark.parametrize("how", ["cancel", "stop"])
    def test_a_motion_that_is_called_off_comes_to_rest_before_its_end(self, station, how):
        trajectory = way(station, 0.4)
        command = station.arm.move(trajectory)
        station.world.wait(trajectory.duration_s / 4)
        command.cancel() if how == "cancel" else station.arm.stop()
        assert command.result.ending is (Ending.CANCELLED if how == "cancel" else Ending.STOPPED)
        station.world.wait(0.6)
        state = station.arm.state()
        np.testing.assert_allclose(state.dq_rad_s, 0.0, atol=0.02)
        assert np.abs(state.q_rad - trajectory.end.q).max() > 0.02
        self.rests(station)

    def test_stopping_twice_is_stopping_once_and_a_stopped_arm_moves_again(self, station):
        station.arm.stop()
        station.arm.stop()
        station.gripper.stop()
        station.gripper.stop()
        self.rests(station)
        assert finish(station.arm.move(way(station, 0.05)), station.world).succeeded

    def test_cancelling_what_has_ended_changes_nothing(self, station):
        command = station.arm.move(way(station, 0.05))
        finish(command, station.world)
        command.cancel()
        assert command.result.ending is Ending.DONE

    def rests(self, station):
        before = station.arm.state().q_rad
        station.world.wait(0.2)
        np.testing.assert_allclose(station.arm.state().q_rad, before, atol=2e-3)

    # ---- set-points --------------------------------------------------------------------------------------------

    def test_a_stream_of_set_points_is_followed_and_has_one_handle(self, station):
        arm, world = station.arm, station.world
        commands, trajectory, begun = set(), way(station, 0.1), world.now_s
        while (t := world.now_s - begun) < trajectory.duration_s:
            aim = trajectory.sample(t)
            commands.add(arm.servo(aim.q, aim.dq))
            world.wait(0.01)
        for _ in range(30):
            commands.add(arm.servo(trajectory.end.q, np.zeros(arm.limits.dof)))
            world.wait(0.01)
        assert len(commands) == 1
        assert not commands.pop().done
        np.testing.assert_allclose(arm.state().q_rad, trajectory.end.q, atol=self.close_rad)

    def test_a_stream_that_falls_silent_comes_to_rest_and_says_so(self, station):
        arm, world = station.arm, station.world
        start, speed = arm.commanded().q, 0.05 * arm.limits.velocity_rad_s
        command = arm.servo(start, speed)
        world.wait(arm.setpoint_timeout_s + 0.5)
        assert command.result.ending is Ending.STOPPED
        way_on = np.abs(arm.state().q_rad - start)
        assert (way_on < speed * arm.setpoint_timeout_s * 2 + self.close_rad).all()
        self.rests(station)

    def test_set_points_beyond_the_limits_are_refused_and_nothing_moves(self, station):
        arm, limits = station.arm, station.arm.limits
        q, still = arm.commanded().q, np.zeros(limits.dof)
        command = arm.servo(q, 2 * limits.velocity_rad_s)
        assert command.result.ending is Ending.REFUSED
        assert "speed" in command.result.reason
        self.rests(station)
        assert arm.servo(np.where(np.arange(limits.dof) == 0, limits.upper_rad + 0.1, q), still).done
        self.rests(station)

    def test_a_set_point_with_nan_raises(self, station):
        dof = station.arm.limits.dof
        with pytest.raises(MotionError, match="finite"):
            station.arm.servo(np.full(dof, np.nan), np.zeros(dof))

    def test_a_trajectory_takes_over_from_a_stream_and_back(self, station):
        arm, world = station.arm, station.world
        stream = arm.servo(arm.commanded().q, np.zeros(arm.limits.dof))
        move = arm.move(way(station, 0.1))
        assert stream.result.ending is Ending.SUPERSEDED
        world.wait(0.1)
        told = arm.commanded()
        arm.servo(told.q, told.dq)
        assert move.result.ending is Ending.SUPERSEDED

    # ---- the gripper -------------------------------------------------------------------------------------------

    def test_fingers_go_to_an_opening_and_back(self, station):
        gripper = station.gripper
        low, high = gripper.opening_range_m
        for opening in (low + 0.4 * (high - low), high):
            command = gripper.move(opening)
            assert not command.done
            assert finish(command, station.world).ending is Ending.DONE
            assert gripper.state().opening_m == pytest.approx(opening, abs=self.close_m)
            assert not gripper.state().holding

    def test_slow_fingers_take_longer(self, station):
        low, high = station.gripper.opening_range_m
        slow, fast = station.gripper.speed_range_mps
        times = []
        for opening, speed in ((low + 0.5 * (high - low), fast), (high, max(slow, fast / 4))):
            begun = station.world.now_s
            finish(station.gripper.move(opening, speed_mps=speed), station.world)
            times.append(station.world.now_s - begun)
        assert times[1] > 1.5 * times[0]

    @pytest.mark.parametrize("name", ["opening_m", "speed_mps", "force_n"])
    def test_what_the_gripper_cannot_do_is_refused_with_its_range(self, station, name):
        gripper = station.gripper
        before = gripper.state().opening_m
        asked = {"opening_m": 0.0} | {name: 1e3}
        command = gripper.move(asked.pop("opening_m"), **asked)
        assert command.result.ending is Ending.REFUSED
        assert name in command.result.reason
        station.world.wait(0.2)
        assert gripper.state().opening_m == pytest.approx(before, abs=1e-4)

    def test_an_opening_that_is_no_number_raises(self, station):
        with pytest.raises(MotionError, match="opening_m"):
            station.gripper.move(float("nan"))

    @pytest.mark.parametrize("how", ["cancel", "stop"])
    def test_fingers_that_are_called_off_stay(self, station, how):
        gripper, world = station.gripper, station.world
        low, high = gripper.opening_range_m
        command = gripper.move(low, speed_mps=gripper.speed_range_mps[0])
        world.wait(0.1)
        command.cancel() if how == "cancel" else gripper.stop()
        assert command.result.ending is (Ending.CANCELLED if how == "cancel" else Ending.STOPPED)
        world.wait(0.2)
        opening = gripper.state().opening_m
        world.wait(0.3)
        assert gripper.state().opening_m == pytest.approx(opening, abs=1e-3)
        assert opening > low + 0.5 * (high - low)

    # ---- the camera --------------------------------------------------------------------------------------------

    def test_a_picture_has_the_size_and_the_stamp_that_it_says(self, station):
        if station.camera is None:
            pytest.skip("this station has no camera")
        station.world.wait(0.1)
        image = station.camera.capture()
        size = image.intrinsics.height_px, image.intrinsics.width_px
        assert image.rgb.shape == (*size, 3)
        assert image.rgb.dtype == np.uint8
        assert image.depth_m.shape == size
        assert image.depth_m.dtype == np.float32
        assert np.nanmin(image.depth_m) > 0
        assert image.frame == station.camera.frame
        assert 0 <= station.world.now_s - image.stamp_s < 0.2


def way(station: Station, step_rad: float) -> Trajectory:
    """From where the arm stands, every joint a little towards the middle of its range."""
    limits, q = station.arm.limits, station.arm.commanded().q
    towards = np.sign((limits.lower_rad + limits.upper_rad) / 2 - q)
    return time_optimal(np.stack([q, q + step_rad * np.where(towards == 0, 1, towards)]), limits).trajectory
