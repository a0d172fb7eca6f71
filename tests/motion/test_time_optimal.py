from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import toppra
from hypothesis import given, settings
from hypothesis import strategies as st
from toppra.algorithm import TOPPRA
from toppra.constraint import JointAccelerationConstraint, JointVelocityConstraint

from tr_grasp.errors import MotionError
from tr_grasp.motion import MotionLimits, Outcome, time_optimal


def wide(dof: int, v: float = 2.0, a: float = 8.0) -> MotionLimits:
    return MotionLimits([-20.0] * dof, [20.0] * dof, [v] * dof, [a] * dof, [60.0] * dof)


def path(seed: int, n: int = 6, dof: int = 3) -> np.ndarray:
    return np.cumsum(np.random.default_rng(seed).normal(0, 0.3, (n, dof)), axis=0)


@pytest.mark.parametrize(
    ("way", "v", "a", "expected_s"),
    # A trapezoid takes way / v + v / a; a triangle, where the way is shorter than v² / a, 2 sqrt(way / a).
    [(1.0, 0.5, 1.0, 2.5), (2.0, 1.0, 4.0, 2.25), (0.2, 1.0, 1.0, 2 * np.sqrt(0.2)), (6.0, 3.0, 9.0, 2 + 1 / 3)],
)
def test_from_rest_to_rest_on_a_line_is_a_trapezoid(way: float, v: float, a: float, expected_s: float) -> None:
    timing = time_optimal([[0.0], [way]], wide(1, v, a))
    assert timing.trajectory is not None
    assert timing.trajectory.duration_s == pytest.approx(expected_s, rel=2e-3)
    middle = timing.trajectory.sample(timing.trajectory.duration_s / 2)
    assert middle.q[0] == pytest.approx(way / 2, abs=1e-3 * way)
    assert middle.dq[0] == pytest.approx(min(v, np.sqrt(way * a)), rel=1e-2)


@settings(max_examples=25)
@given(seed=st.integers(0, 10_000), n=st.integers(2, 12))
def test_no_limit_is_exceeded_anywhere(seed: int, n: int) -> None:
    limits, way = wide(3), path(seed, n)
    trajectory = time_optimal(way, limits).trajectory
    assert trajectory is not None
    assert trajectory.violations(limits, margin=0.0) == []
    assert trajectory.q_rad[[0, -1]] == pytest.approx(way[[0, -1]])
    assert np.abs(trajectory.dq_rad_s[[0, -1]]).max() < 1e-9
    # Time-optimal: at nearly every time something is at its limit.
    state = trajectory.sample(np.linspace(0.02, 0.98, 200) * trajectory.duration_s)
    used = np.maximum(np.abs(state.dq) / 2.0, np.abs(state.ddq) / 8.0).max(1)
    assert np.mean(used > 0.8) > 0.8


@pytest.mark.parametrize("seed", range(5))
def test_corners_are_hardly_rounded(seed: int) -> None:
    way = path(seed)
    trajectory = time_optimal(way, wide(3)).trajectory
    assert trajectory is not None
    points = trajectory.sample(np.linspace(0, trajectory.duration_s, 500)).q
    gaps = [min(gap_to_line(q, a, b) for a, b in pairwise(way)) for q in points]
    assert max(gaps) < 0.02


def gap_to_line(q: np.ndarray, a: np.ndarray, b: np.ndarray) -> float:
    share = np.clip((q - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
    return float(np.linalg.norm(a + share * (b - a) - q))


def test_the_library_s_own_example_takes_as_long() -> None:
    """The random spline of TOPP-RA's tutorial: the same path in the library's hands, on a very fine grid."""
    rng = np.random.default_rng(0)
    knots = np.linspace(0, 1, 5)
    waypoints = rng.uniform(-2, 2, (5, 6)) / 2
    v = 10 + rng.random(6) * 20
    a = 10 + rng.random(6) * 2
    spline = toppra.SplineInterpolator(knots, waypoints)
    constraints = [JointVelocityConstraint(np.stack([-v, v], 1)), JointAccelerationConstraint(np.stack([-a, a], 1))]
    expected = TOPPRA(constraints, spline, gridpoints=np.linspace(0, 1, 2000)).compute_trajectory()
    limits = MotionLimits([-9.0] * 6, [9.0] * 6, v, a, [1e3] * 6)
    # So many points of the curve that ours is the same curve.
    ours = time_optimal(spline(np.linspace(0, 1, 60)), limits, spacing_rad=1.0)
    assert ours.trajectory is not None
    assert ours.trajectory.duration_s == pytest.approx(expected.duration, rel=0.03)
    assert ours.trajectory.violations(limits, margin=0.0) == []


@pytest.mark.parametrize("seed", range(6))
def test_it_starts_and_ends_as_fast_as_asked(seed: int) -> None:
    way = path(seed)
    start, end = (0.5 * (b - a) / np.linalg.norm(b - a) for a, b in (way[:2], way[-2:]))
    timing = time_optimal(way, wide(3), start_speed_rad_s=start, end_speed_rad_s=end)
    assert timing.trajectory is not None, timing.reason
    assert timing.trajectory.start.dq == pytest.approx(start, abs=1e-6)
    assert timing.trajectory.end.dq == pytest.approx(end, abs=1e-6)
    assert timing.trajectory.violations(wide(3), margin=0.0) == []


def test_a_speed_a_little_off_the_path_bends_it() -> None:
    way = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]])
    start = np.array([0.6, 0.15])
    timing = time_optimal(way, wide(2), start_speed_rad_s=start)
    assert timing.trajectory is not None
    assert timing.trajectory.start.dq == pytest.approx(start, abs=1e-6)
    assert timing.trajectory.violations(wide(2), margin=0.0) == []


def test_a_start_too_fast_to_brake_from_is_infeasible() -> None:
    # 2 rad/s takes 0.25 rad to brake at 8 rad/s²; the path has 0.1 rad.
    timing = time_optimal([[0.0], [0.1]], wide(1), start_speed_rad_s=[2.0])
    assert timing.outcome is Outcome.INFEASIBLE_SPEED
    assert timing.trajectory is None
    above = time_optimal([[0.0], [9.0]], wide(1), start_speed_rad_s=[2.1])
    assert above.outcome is Outcome.INFEASIBLE_SPEED
    assert "above the limits" in above.reason


def test_repeated_waypoints_are_one() -> None:
    once = time_optimal([[0.0, 0.0], [0.5, 0.2], [1.0, 0.0]], wide(2)).trajectory
    twice = time_optimal([[0.0, 0.0], [0.5, 0.2], [0.5, 0.2], [1.0, 0.0], [1.0, 0.0]], wide(2)).trajectory
    assert once is not None
    assert twice is not None
    assert twice.duration_s == once.duration_s


def test_a_path_of_no_length_rests_where_it_is() -> None:
    timing = time_optimal([[0.3, 0.4], [0.3, 0.4]], wide(2))
    assert timing.outcome is Outcome.ALREADY_THERE
    assert timing.trajectory is not None
    assert (timing.trajectory.q_rad == [0.3, 0.4]).all()
    assert not timing.trajectory.dq_rad_s.any()


def test_a_waypoint_outside_the_limits_is_named() -> None:
    timing = time_optimal([[0.0, 0.0], [0.0, 21.0]], wide(2))
    assert timing.outcome is Outcome.PATH_OUTSIDE_LIMITS
    assert "joint 1 is at 21 rad in waypoint 1" in timing.reason


@pytest.mark.parametrize(
    "waypoints", [[[0.0, np.nan], [1.0, 1.0]], [[0.0], [1.0]], np.zeros((0, 2)), [[0.0, 0.0], [np.inf, 0.0]]]
)
def test_waypoints_that_are_none_are_refused(waypoints) -> None:
    with pytest.raises(MotionError, match="waypoints"):
        time_optimal(waypoints, wide(2))


def test_speeds_and_spacing_are_checked() -> None:
    with pytest.raises(MotionError, match="start_speed_rad_s"):
        time_optimal([[0.0, 0.0], [1.0, 1.0]], wide(2), start_speed_rad_s=[0.1])
    with pytest.raises(MotionError, match="spacing_rad"):
        time_optimal([[0.0, 0.0], [1.0, 1.0]], wide(2), spacing_rad=0.0)
