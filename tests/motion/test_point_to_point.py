from __future__ import annotations

import numpy as np
import pytest
import ruckig
from hypothesis import given, settings
from hypothesis import strategies as st

from tr_grasp.errors import MotionError
from tr_grasp.motion import JointState, MotionLimits, Outcome, point_to_point
from tr_grasp.motion.point_to_point import ruckig_input

LIMITS = MotionLimits([-9.0] * 3, [9.0] * 3, [1.0, 2.0, 1.5], [4.0, 3.0, 5.0], [40.0, 30.0, 50.0])


def states(seed: int) -> tuple[JointState, JointState]:
    rng = np.random.default_rng(seed)
    start = JointState(rng.normal(size=3), rng.uniform(-0.9, 0.9, 3), rng.normal(size=3))
    return start, JointState(rng.normal(size=3), rng.uniform(-0.8, 0.8, 3), np.zeros(3))


def test_a_full_profile_takes_the_time_worked_by_hand() -> None:
    # Way / v + v / a + a / j = 2 + 0.25 + 0.1 s, with all seven phases.
    limits = MotionLimits([-9.0], [9.0], [1.0], [4.0], [40.0])
    timing = point_to_point(JointState.at_rest([0.0]), JointState.at_rest([2.0]), limits)
    assert timing.trajectory is not None
    assert timing.trajectory.duration_s == pytest.approx(2.35, abs=1e-9)
    assert timing.trajectory.sample(1.175).q[0] == pytest.approx(1.0)
    assert timing.trajectory.peaks()["jerk"][0] == pytest.approx(40.0, rel=1e-6)


def test_it_takes_as_long_as_asked_but_never_less_than_it_needs() -> None:
    """The same 2 rad need 2.35 s."""
    limits = MotionLimits([-9.0], [9.0], [1.0], [4.0], [40.0])
    for asked_s, taken_s in ((5.0, 5.0), (2.0, 2.35)):
        timing = point_to_point(JointState.at_rest([0.0]), JointState.at_rest([2.0]), limits, at_least_s=asked_s)
        assert timing.trajectory is not None
        assert timing.trajectory.duration_s == pytest.approx(taken_s, abs=1e-6)
        assert timing.trajectory.end.q == pytest.approx([2.0])


@settings(max_examples=50)
@given(seed=st.integers(0, 10_000))
def test_it_joins_both_states_within_all_limits(seed: int) -> None:
    start, goal = states(seed)
    trajectory = point_to_point(start, goal, LIMITS).trajectory
    assert trajectory is not None
    assert trajectory.start.q == pytest.approx(start.q, abs=1e-9)
    assert trajectory.start.dq == pytest.approx(start.dq, abs=1e-9)
    assert trajectory.end.q == pytest.approx(goal.q, abs=1e-9)
    assert trajectory.end.dq == pytest.approx(goal.dq, abs=1e-9)
    assert trajectory.violations(LIMITS, margin=5e-3, with_jerk=True) == []


@pytest.mark.parametrize("seed", range(10))
def test_the_cubics_are_ruckig_s_own_trajectory(seed: int) -> None:
    start, goal = states(seed)
    request = ruckig_input(LIMITS)
    request.current_position, request.current_velocity, request.current_acceleration = start.q, start.dq, start.ddq
    request.target_position, request.target_velocity = goal.q, goal.dq
    theirs = ruckig.Trajectory(3)
    ruckig.Ruckig(3).calculate(request, theirs)
    ours = point_to_point(start, goal, LIMITS).trajectory
    assert ours is not None
    assert ours.duration_s == pytest.approx(theirs.duration)
    for t in np.linspace(0, theirs.duration, 100):
        q, dq, ddq = theirs.at_time(t)
        state = ours.sample(t)
        assert state.q == pytest.approx(q, abs=1e-8)
        assert state.dq == pytest.approx(dq, abs=1e-5)
        assert state.ddq == pytest.approx(ddq, abs=5e-3)


def test_what_cannot_be_reached_says_why() -> None:
    rest = JointState.at_rest([0.0] * 3)
    outside = point_to_point(rest, JointState.at_rest([0.0, 9.5, 0.0]), LIMITS)
    assert outside.outcome is Outcome.GOAL_OUTSIDE_LIMITS
    fast = point_to_point(rest, JointState(np.ones(3), np.full(3, 1.2), np.zeros(3)), LIMITS)
    assert fast.outcome is Outcome.INFEASIBLE_SPEED
    over = point_to_point(
        JointState(np.array([8.99, 0, 0]), np.array([0.9, 0, 0]), np.zeros(3)), JointState.at_rest([0.0] * 3), LIMITS
    )
    assert over.outcome is Outcome.PATH_OUTSIDE_LIMITS
    assert {outside.trajectory, fast.trajectory, over.trajectory} == {None}


def test_where_it_is_already_it_rests() -> None:
    rest = JointState.at_rest([0.1, 0.2, 0.3])
    timing = point_to_point(rest, rest, LIMITS)
    assert timing.outcome is Outcome.ALREADY_THERE
    assert timing.trajectory is not None
    assert not timing.trajectory.dq_rad_s.any()


def test_states_of_other_arms_and_nan_are_refused() -> None:
    rest = JointState.at_rest([0.0] * 3)
    with pytest.raises(MotionError, match=r"goal\.q"):
        point_to_point(rest, JointState.at_rest([0.0] * 4), LIMITS)
    with pytest.raises(MotionError, match=r"start\.dq must be finite"):
        point_to_point(JointState(np.zeros(3), np.array([0, np.nan, 0]), np.zeros(3)), rest, LIMITS)
