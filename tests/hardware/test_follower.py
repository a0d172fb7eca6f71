import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tr_grasp.errors import MotionError
from tr_grasp.hardware import Ending, Follower
from tr_grasp.motion import MotionLimits, Trajectory, time_optimal

LIMITS = MotionLimits([-3.0, -2.0], [3.0, 2.0], [1.0, 2.0], [4.0, 4.0], [40.0, 40.0])
ZERO = np.zeros(2)


class Clock:
    now = 0.0

    def __call__(self):
        return self.now


def follower():
    clock = Clock()
    return Follower(LIMITS, ZERO, clock), clock


def test_a_brake_from_1_rad_s_at_4_rad_s2_takes_a_quarter_of_a_second_and_an_eighth_of_a_radian():
    f, clock = follower()
    f.servo(ZERO, [1.0, 0.0])
    clock.now = 0.05
    f.stop()
    assert f.commanded().q == pytest.approx([0.05, 0.0])
    assert f.commanded(0.175).dq == pytest.approx([0.5, 0.0])
    clock.now = 0.05 + 0.25
    assert f.update().q == pytest.approx([0.05 + 0.125, 0.0])
    assert f.commanded(9.0).q == pytest.approx([0.175, 0.0])


@given(st.floats(-1, 1), st.floats(-2, 2), st.floats(0.0, 0.5))
def test_whatever_goes_on_stopping_keeps_position_and_speed_continuous_and_the_limits(a, b, when):
    f, clock = follower()
    f.servo(ZERO, [a, b])
    clock.now = when
    before = f.commanded()
    f.stop()
    after = f.commanded()
    np.testing.assert_allclose(after.q, before.q, atol=1e-9)
    np.testing.assert_allclose(after.dq, before.dq, atol=1e-5)
    times = np.linspace(when, when + 2, 400)
    speeds = np.array([f.commanded(t).dq for t in times])
    assert (np.abs(np.diff(speeds, axis=0)) / np.diff(times)[:, None] <= LIMITS.acceleration_rad_s2 * 1.01).all()
    np.testing.assert_allclose(speeds[-1], 0.0, atol=1e-12)


def test_a_brake_that_is_under_way_is_not_begun_anew():
    f, clock = follower()
    f.servo(ZERO, [1.0, 0.0])
    f.stop()
    clock.now = 0.1
    expected = f.commanded(0.2).q
    f.stop()
    np.testing.assert_array_equal(f.commanded(0.2).q, expected)


def test_a_trajectory_that_ends_in_motion_is_followed_by_a_brake():
    f, clock = follower()
    command = f.move(Trajectory([0.0, 1.0], [ZERO, [0.25, 0.0]], [ZERO, [0.5, 0.0]]))
    clock.now = 1.0
    f.update()
    assert command.result.ending is Ending.DONE
    assert f.commanded(1.0 + 0.125).q == pytest.approx([0.25 + 0.5 * 0.125 / 2, 0.0])
    assert f.commanded(2.0).dq == pytest.approx([0.0, 0.0])


def test_a_trajectory_that_waits_is_cancelled_without_disturbing_the_one_before():
    f, clock = follower()
    trajectory = time_optimal([ZERO, [0.5, 0.5]], LIMITS).trajectory
    first = f.move(trajectory)
    there = f.commanded(0.3)
    waiting = f.move(Trajectory([0.0, 0.5], [there.q, there.q + there.dq * 0.25], [there.dq, ZERO]), at_s=0.3)
    clock.now = 0.1
    waiting.cancel()
    assert waiting.result.ending is Ending.CANCELLED
    clock.now = trajectory.duration_s
    f.update()
    assert first.result.ending is Ending.DONE
    np.testing.assert_allclose(f.commanded().q, [0.5, 0.5])


def test_a_trajectory_that_begins_when_another_ends_lets_it_be_carried_out():
    f, clock = follower()
    there = time_optimal([ZERO, [0.5, 0.5]], LIMITS).trajectory
    back = time_optimal([[0.5, 0.5], ZERO], LIMITS).trajectory
    first, second = f.move(there), f.move(back, at_s=there.duration_s)
    clock.now = there.duration_s + 0.01
    f.update()
    assert first.result.ending is Ending.DONE
    clock.now = 5.0
    f.update()
    assert second.result.ending is Ending.DONE
    assert f.is_idle


def test_a_later_trajectory_replaces_one_that_waits():
    f, _ = follower()
    trajectory = time_optimal([ZERO, [0.5, 0.5]], LIMITS).trajectory
    first, second = f.move(trajectory, at_s=1.0), f.move(trajectory, at_s=0.5)
    assert first.result.ending is Ending.SUPERSEDED
    assert not second.done


def test_a_set_point_further_than_the_arm_comes_is_refused():
    f, _ = follower()
    assert "0.11 rad away" in f.servo([0.11, 0.0], ZERO).result.reason
    assert not f.servo([0.09, 0.19], ZERO).done


def test_what_is_no_time_out_raises():
    with pytest.raises(MotionError, match="setpoint_timeout_s"):
        Follower(LIMITS, ZERO, Clock(), setpoint_timeout_s=0.0)
