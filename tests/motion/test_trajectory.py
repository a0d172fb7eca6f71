from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tr_grasp.errors import MotionError, StorageError
from tr_grasp.motion import JointState, MotionLimits, Trajectory

# One joint from rest at 0 to rest at 1 in 2 s: q = 3/4 t² - t³/4, dq = 3/2 t - 3/4 t², ddq = 3/2 - 3/2 t.
REST_TO_REST = Trajectory(np.array([0.0, 2.0]), np.array([[0.0], [1.0]]), np.zeros((2, 1)))


def random_trajectory(seed: int, dof: int = 3, knots: int = 6) -> Trajectory:
    rng = np.random.default_rng(seed)
    times = np.append(0.0, np.cumsum(rng.uniform(0.05, 0.8, knots - 1)))
    return Trajectory(times, rng.normal(size=(knots, dof)), rng.normal(size=(knots, dof)))


def limits(v: float, a: float, j: float, reach: float = 10.0) -> MotionLimits:
    return MotionLimits([-reach], [reach], [v], [a], [j])


def test_a_cubic_from_rest_to_rest_is_the_one_worked_by_hand() -> None:
    state = REST_TO_REST.sample(1.0)
    assert state.q == pytest.approx([0.5])
    assert state.dq == pytest.approx([0.75])
    assert state.ddq == pytest.approx([0.0])
    assert {name: value[0] for name, value in REST_TO_REST.peaks().items()} == pytest.approx(
        {"lower": 0.0, "upper": 1.0, "velocity": 0.75, "acceleration": 1.5, "jerk": 1.5}
    )


@given(seed=st.integers(0, 200))
def test_peaks_are_those_of_a_very_fine_sampling(seed: int) -> None:
    trajectory = random_trajectory(seed)
    state = trajectory.sample(np.linspace(0, trajectory.duration_s, 20_001))
    peaks = trajectory.peaks()
    assert np.allclose(peaks["lower"], state.q.min(0), atol=1e-5)
    assert np.allclose(peaks["upper"], state.q.max(0), atol=1e-5)
    assert np.allclose(peaks["velocity"], np.abs(state.dq).max(0), rtol=1e-3)
    assert (peaks["acceleration"] >= np.abs(state.ddq).max(0) - 1e-9).all()
    assert np.allclose(peaks["acceleration"], np.abs(state.ddq).max(0), rtol=1e-2)


@given(seed=st.integers(0, 50), share=st.floats(0.05, 0.95))
def test_a_rest_is_what_is_left(seed: int, share: float) -> None:
    whole = random_trajectory(seed)
    start = share * whole.duration_s
    rest = whole.cut(start)
    times = np.linspace(0, rest.duration_s, 50)
    assert rest.duration_s == pytest.approx(whole.duration_s - start)
    # A rounding beyond the end is at rest already.
    later = np.minimum(times + start, whole.duration_s)
    assert np.allclose(rest.sample(times).q, whole.sample(later).q, atol=1e-9)
    assert np.allclose(rest.sample(times).dq, whole.sample(later).dq, atol=1e-7)


@given(seed=st.integers(0, 50), share=st.floats(0.05, 0.95))
def test_a_beginning_spliced_with_its_rest_is_the_whole(seed: int, share: float) -> None:
    whole = random_trajectory(seed)
    at_s = share * whole.duration_s
    joined = whole.splice(whole.cut(at_s), at_s)
    times = np.linspace(0, whole.duration_s, 50)
    assert np.allclose(joined.sample(times).q, whole.sample(times).q, atol=1e-9)


def test_a_splice_refuses_a_leap() -> None:
    elsewhere = Trajectory(np.array([0.0, 1.0]), np.array([[0.6], [1.0]]), np.zeros((2, 1)))
    with pytest.raises(MotionError, match=r"0\.1 rad"):
        REST_TO_REST.splice(elsewhere, 1.0)


def test_twice_the_time_halves_speed_and_quarters_acceleration() -> None:
    peaks = REST_TO_REST.slower(2.0).peaks()
    assert peaks["velocity"][0] == pytest.approx(0.375)
    assert peaks["acceleration"][0] == pytest.approx(0.375)


def test_before_and_after_it_the_arm_stands() -> None:
    moving = Trajectory(np.array([0.0, 1.0]), np.array([[0.0], [1.0]]), np.ones((2, 1)))
    for time, q in ((-1.0, 0.0), (3.0, 1.0)):
        state = moving.sample(time)
        assert (state.q[0], state.dq[0], state.ddq[0]) == (q, 0.0, 0.0)
    assert moving.end.dq[0] == 1.0


@pytest.mark.parametrize(
    ("given_limits", "quantity"),
    [
        (limits(0.74, 2, 2), "velocity"),
        (limits(1, 1.49, 2), "acceleration"),
        (limits(1, 2, 1.49), "jerk"),
        (limits(1, 2, 2, reach=0.99), "position"),
    ],
)
def test_each_limit_that_is_exceeded_is_named(given_limits: MotionLimits, quantity: str) -> None:
    found = REST_TO_REST.violations(given_limits, with_jerk=True)
    assert [violation.quantity for violation in found] == [quantity]
    assert "joint 0 reaches" in str(found[0])


def test_limits_that_are_just_kept_are_kept() -> None:
    assert REST_TO_REST.violations(limits(0.75, 1.5, 1.5, reach=1.0), with_jerk=True) == []


def test_speed_that_peaks_between_the_knots_is_found() -> None:
    assert REST_TO_REST.dq_rad_s.max() == 0.0
    assert REST_TO_REST.violations(limits(0.5, 9, 9)) != []


def test_samples_at_a_period_end_at_the_end() -> None:
    times, state = REST_TO_REST.every(0.3)
    assert times == pytest.approx([0, 0.3, 0.6, 0.9, 1.2, 1.5, 1.8, 2.0])
    assert state.q.shape == (8, 1)


def test_what_was_saved_can_be_loaded(tmp_path: Path) -> None:
    saved = random_trajectory(3)
    loaded = Trajectory.load(saved.save(tmp_path / "a.json"))
    assert loaded.q_rad == pytest.approx(saved.q_rad, abs=1e-12)
    assert np.array_equal(loaded.times_s, saved.times_s)


def test_a_table_has_a_row_for_each_sample(tmp_path: Path) -> None:
    lines = REST_TO_REST.save(tmp_path / "a.csv", period_s=1.0).read_text().splitlines()
    assert lines[0] == "time_s,q0,dq0,ddq0"
    assert lines[2] == "1,0.5,0.75,0"
    assert len(lines) == 4


def test_other_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(MotionError, match=r"\.json or \.csv"):
        REST_TO_REST.save(tmp_path / "a.txt")
    (tmp_path / "b.json").write_text("[]")
    with pytest.raises(StorageError, match="holds no trajectory"):
        Trajectory.load(tmp_path / "b.json")


@pytest.mark.parametrize(
    ("times", "q", "dq"),
    [
        ([0.0], [[0.0]], [[0.0]]),
        ([0.0, 0.0], [[0.0], [1.0]], [[0.0], [0.0]]),
        ([0.1, 1.0], [[0.0], [1.0]], [[0.0], [0.0]]),
        ([0.0, np.nan], [[0.0], [1.0]], [[0.0], [0.0]]),
        ([0.0, 1.0], [[0.0], [np.nan]], [[0.0], [0.0]]),
        ([0.0, 1.0], [[0.0], [1.0]], [[0.0, 0.0], [0.0, 0.0]]),
    ],
)
def test_what_is_no_trajectory_is_refused(times, q, dq) -> None:
    with pytest.raises(MotionError):
        Trajectory(np.array(times), np.array(q), np.array(dq))


def test_a_state_at_rest_does_not_move() -> None:
    state = JointState.at_rest([1.0, 2.0])
    assert not state.dq.any()
    assert not state.ddq.any()
