from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from tr_grasp.errors import MotionError
from tr_grasp.motion import JointState, MotionLimits, Servo, point_to_point

PERIOD_S = 1 / 240


def run(servo: Servo, ticks: int, tick: Callable[[int], JointState]) -> dict[str, np.ndarray]:
    states = [servo.state, *(tick(i) for i in range(ticks))]
    return {name: np.array([getattr(state, name) for state in states]) for name in ("q", "dq", "ddq")}


def assert_within(limits: MotionLimits, motion: dict[str, np.ndarray]) -> None:
    assert (np.abs(motion["dq"]) <= limits.velocity_rad_s * (1 + 1e-6)).all()
    assert (np.abs(motion["ddq"]) <= limits.acceleration_rad_s2 * (1 + 1e-6)).all()
    jerk = np.diff(motion["ddq"], axis=0) / PERIOD_S
    assert (np.abs(jerk) <= limits.jerk_rad_s3 * (1 + 1e-6)).all()
    assert (motion["q"] >= limits.lower_rad - 1e-3).all()
    assert (motion["q"] <= limits.upper_rad + 1e-3).all()


def moving(t: float) -> tuple[np.ndarray, np.ndarray]:
    q = np.array([0.5 + 0.2 * t, 0.3 * np.sin(t), -0.4])
    return q, np.array([0.2, 0.3 * np.cos(t), 0.0])


@pytest.mark.parametrize("share", [1.0, 0.1])
def test_it_catches_a_moving_target_and_stays_with_it(limits: MotionLimits, share: float) -> None:
    limits = limits.scaled(share)
    servo = Servo(limits, PERIOD_S)
    servo.start(np.zeros(3))
    slow = 1.0 if share == 1.0 else 0.1
    target = [moving(slow * (i + 1) * PERIOD_S) for i in range(2400)]
    motion = run(servo, 2400, lambda i: servo.track(target[i][0], slow * target[i][1]))
    gap = np.abs(motion["q"][1:] - [q for q, _ in target]).max(1)
    assert gap[-600:].max() < 3e-3
    assert_within(limits, motion)


def test_without_the_target_s_speed_it_lags(limits: MotionLimits) -> None:
    servo = Servo(limits, PERIOD_S)
    servo.start(np.zeros(3))
    motion = run(servo, 1200, lambda i: servo.track(moving((i + 1) * PERIOD_S)[0]))
    # A proportional law stays speed / gain behind.
    assert moving(1200 * PERIOD_S)[0][0] - motion["q"][-1, 0] == pytest.approx(0.2 / servo.gain, rel=0.1)


def test_a_target_that_leaps_breaks_no_limit(limits: MotionLimits) -> None:
    rng = np.random.default_rng(0)
    servo = Servo(limits, PERIOD_S)
    servo.start(np.zeros(3))
    targets = rng.uniform(-6, 6, (25, 3))
    speeds = rng.uniform(-3, 3, (25, 3))
    assert_within(limits, run(servo, 2400, lambda i: servo.track(targets[i // 96], speeds[i // 96])))


def test_it_stops_soon_and_stays(limits: MotionLimits) -> None:
    servo = Servo(limits, PERIOD_S)
    servo.start(np.zeros(3), dq=[0.9, -1.5, 0.2])
    motion = run(servo, 240, lambda _: servo.stop())
    assert servo.is_at_rest
    # v / a + a / j, the slowest joint: 1.5 / 3 + 3 / 30.
    assert np.abs(motion["dq"][int(0.61 / PERIOD_S)]).max() < 1e-6
    assert_within(limits, motion)
    before = servo.state.q
    assert servo.stop().q == pytest.approx(before, abs=1e-12)


def test_a_speed_is_followed_until_a_joint_limit(limits: MotionLimits) -> None:
    servo = Servo(limits, PERIOD_S)
    servo.start(np.zeros(3))
    motion = run(servo, 2400, lambda _: servo.move([0.8, 5.0, 0.0]))
    assert motion["dq"][200, 0] == pytest.approx(0.8)
    assert motion["dq"][:, 1].max() > 1.8
    assert motion["q"][-1, :2] == pytest.approx(limits.upper_rad[:2], abs=2e-3)
    assert_within(limits, motion)


def test_its_steps_are_the_point_to_point_trajectory_sampled(limits: MotionLimits) -> None:
    servo, goal = Servo(limits, PERIOD_S), np.array([1.0, -0.7, 0.4])
    servo.start(np.zeros(3), dq=[0.2, 0.1, -0.3])
    trajectory = point_to_point(servo.state, JointState.at_rest(goal), limits).trajectory
    assert trajectory is not None
    motion = run(servo, 400, lambda _: servo.reach(goal))
    sampled = trajectory.sample(np.arange(401) * PERIOD_S)
    assert motion["q"] == pytest.approx(sampled.q, abs=1e-5)
    assert motion["dq"] == pytest.approx(sampled.dq, abs=1e-4)
    assert motion["q"][-1] == pytest.approx(goal, abs=1e-9)


def test_the_gain_follows_the_limits() -> None:
    soft = MotionLimits([-9.0], [9.0], [1.0], [8.0], [16.0])
    stiff = MotionLimits([-9.0], [9.0], [1.0], [8.0], [8000.0])
    assert Servo(soft).gain == 2.0
    assert Servo(stiff).gain == 8.0


def test_a_refused_command_moves_nothing(limits: MotionLimits) -> None:
    servo = Servo(limits, PERIOD_S)
    servo.start(np.zeros(3), dq=[0.1, 0.0, 0.0])
    before = servo.state
    refused = [
        lambda: servo.track([0.0, np.nan, 0.0]),
        lambda: servo.track([0.0, 0.0]),
        lambda: servo.track([0.0, 0.0, 0.0], [0.0]),
        lambda: servo.move([np.inf, 0.0, 0.0]),
        lambda: servo.reach([3.5, 0.0, 0.0]),
        lambda: servo.reach([0.0, 0.0, 0.0], [1.5, 0.0, 0.0]),
        lambda: servo.start([0.0, 0.0]),
    ]
    for command in refused:
        with pytest.raises(MotionError):
            command()
        assert servo.state is before


def test_it_must_know_where_the_arm_is(limits: MotionLimits) -> None:
    with pytest.raises(MotionError, match=r"call start\(q\) first"):
        Servo(limits).track(np.zeros(3))


@pytest.mark.parametrize("settings", [{"period_s": 0.0}, {"gain": -1.0}, {"period_s": np.nan}])
def test_period_and_gain_must_be_positive(limits: MotionLimits, settings: dict[str, float]) -> None:
    with pytest.raises(MotionError, match="must be positive"):
        Servo(limits, **settings)
