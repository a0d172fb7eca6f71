"""What holds for every predictor: stamps, losses, leaps, age, headings."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from tr_grasp.errors import CheckpointError, PredictionError
from tr_grasp.prediction import (
    ConstantVelocityPredictor,
    HarmonicBankPredictor,
    HoldPredictor,
    HybridPredictor,
    KalmanCfg,
    KalmanPredictor,
    LSTMPredictor,
    MLPPredictor,
    Predictor,
    Update,
    make_predictor,
)
from tr_grasp.prediction.networks import MotionLSTM, MotionMLP
from tr_grasp.prediction.weights import save_weights
from tr_grasp.prediction.yaw import YawTracker, wrapped

SETTINGS = {"ahead_s": [1.2, 2.2], "sigma_m": [0.01, 0.02]}
NETWORKS = {"mlp": (MotionMLP, MLPPredictor), "lstm": (MotionLSTM, LSTMPredictor)}


def saved(folder: Path, kind: str) -> Path:
    torch.manual_seed(0)
    path = folder / f"{kind}.safetensors"
    save_weights(path, kind, NETWORKS[kind][0]().state_dict(), SETTINGS, {})
    return path


MAKERS: dict[str, Callable[[Path], Predictor]] = {
    "hold": lambda folder: HoldPredictor(),
    "constant_velocity": lambda folder: ConstantVelocityPredictor(),
    "kalman_thesis": lambda folder: KalmanPredictor(KalmanCfg.thesis()),
    "kalman": lambda folder: KalmanPredictor(),
    "harmonic_bank": lambda folder: HarmonicBankPredictor(),
    "hybrid": lambda folder: HybridPredictor(weights=None),
    "mlp": lambda folder: MLPPredictor(saved(folder, "mlp")),
    "lstm": lambda folder: LSTMPredictor(saved(folder, "lstm")),
}
MOVING = ["constant_velocity", "kalman", "harmonic_bank", "hybrid"]


@pytest.fixture(params=sorted(MAKERS))
def predictor(request: pytest.FixtureRequest, tmp_path: Path) -> Predictor:
    return MAKERS[request.param](tmp_path)


def feed(predictor: Predictor, n: int = 15, period_s: float = 0.2) -> float:
    """A line at 3 cm/s along x, half as fast along y."""
    for index in range(n):
        assert (
            predictor.update(index * period_s, [0.03 * index * period_s, 0.015 * index * period_s, 0.1]) is Update.TAKEN
        )
    return (n - 1) * period_s


def same(first: Predictor, second: Predictor, now: float) -> bool:
    one, other = (each.predict([0.5, 2.0], now) for each in (first, second))
    return np.array_equal(one.position, other.position) and np.array_equal(one.covariance, other.covariance)


def test_predictions_have_the_promised_shapes_and_proper_covariances(predictor: Predictor) -> None:
    feed(predictor)
    found = predictor.predict([0.0, 0.3, 1.0, 2.0, 5.0])
    assert found.position.shape == found.velocity.shape == (5, 3)
    assert found.covariance.shape == (5, 3, 3)
    assert np.allclose(found.covariance, found.covariance.swapaxes(-1, -2), atol=1e-12)
    assert np.linalg.eigvalsh(found.covariance).min() > 0
    assert found.yaw is None
    variances = np.trace(found.covariance, axis1=1, axis2=2)
    assert (np.diff(variances) > -1e-12).all()


def test_a_first_measurement_is_enough_to_predict(predictor: Predictor) -> None:
    assert predictor.update(7.0, [0.1, 0.2, 0.3]) is Update.TAKEN
    assert np.isfinite(predictor.predict([1.0]).position).all()


def test_bad_measurements_change_nothing_but_the_present(predictor: Predictor, tmp_path: Path) -> None:
    last = feed(predictor)
    before = predictor.predict([0.5, 2.0], last)
    assert predictor.update(last, [9.0, 9.0, 9.0]) is Update.REPEATED
    assert predictor.update(last - 0.1, [9.0, 9.0, 9.0]) is Update.LATE
    assert np.array_equal(before.position, predictor.predict([0.5, 2.0]).position)
    assert predictor.update(last + 0.2, [math.nan, 0.0, 0.0]) is Update.LOST
    assert predictor.update(last + 0.4, [9.0, 9.0, 9.0]) is Update.OUTLIER
    assert predictor.newest_s == last + 0.4
    assert np.allclose(predictor.predict([0.1, 1.6]).position, before.position)


def test_a_stamp_that_is_no_time_is_refused(predictor: Predictor) -> None:
    for stamp in (math.nan, math.inf):
        with pytest.raises(PredictionError, match="t must be a finite time"):
            predictor.update(stamp, [0.0, 0.0, 0.0])
    with pytest.raises(PredictionError, match="position must be"):
        predictor.update(0.0, [0.0, 0.0])


def test_asking_the_impossible_is_refused(predictor: Predictor) -> None:
    with pytest.raises(PredictionError, match="call update"):
        predictor.predict([1.0])
    last = feed(predictor, 3)
    with pytest.raises(PredictionError, match="now must not be before"):
        predictor.predict([1.0], now=last - 0.1)
    for horizons in ([-1.0], [math.nan], [[1.0]]):
        with pytest.raises(PredictionError, match="horizons_s"):
            predictor.predict(horizons)


def test_after_a_leap_only_the_new_place_counts(predictor: Predictor, tmp_path: Path) -> None:
    last = feed(predictor)
    assert predictor.update(last + 0.2, [3.0, 0.0, 0.0]) is Update.OUTLIER
    assert predictor.update(last + 0.4, [3.01, 0.0, 0.0]) is Update.RESTARTED
    leaped = predictor.predict([0.0, 1.0])
    predictor.reset()
    predictor.update(0.0, [3.0, 0.0, 0.0])
    predictor.update(0.2, [3.01, 0.0, 0.0])
    assert np.allclose(leaped.position, predictor.predict([0.0, 1.0]).position, atol=1e-9)


def test_one_outlier_is_forgotten(predictor: Predictor) -> None:
    last = feed(predictor)
    assert predictor.update(last + 0.2, [3.0, 0.0, 0.0]) is Update.OUTLIER
    assert predictor.update(last + 0.4, [0.03 * (last + 0.4), 0.015 * (last + 0.4), 0.1]) is Update.TAKEN


def test_reset_forgets_everything(predictor: Predictor) -> None:
    feed(predictor)
    first = predictor.predict([1.0]).position
    predictor.reset()
    assert predictor.newest_s is None
    last = feed(predictor)
    assert np.array_equal(first, predictor.predict([1.0], last).position)


def test_the_age_of_a_measurement_counts(predictor: Predictor) -> None:
    last = feed(predictor)
    late, early = predictor.predict([0.5], now=last + 0.7), predictor.predict([1.2], now=last)
    assert np.allclose(late.position, early.position)
    assert np.allclose(late.covariance, early.covariance)


@pytest.mark.parametrize("name", MOVING)
@given(seed=st.integers(0, 100))
@settings(max_examples=3)
def test_a_line_is_foreseen_whatever_the_stamps(name: str, seed: int) -> None:
    predictor, rng = MAKERS[name](Path()), np.random.default_rng(seed)
    times = np.cumsum(rng.uniform(0.02, 0.3, 40))
    velocity = rng.uniform(-0.05, 0.05, 3)
    for t in times:
        predictor.update(t, velocity * t)
    found = predictor.predict([1.0, 2.0])
    assert np.abs(found.position - np.outer(times[-1] + np.array([1.0, 2.0]), velocity)).max() < 2e-3
    assert np.abs(found.velocity - velocity).max() < 1e-3


def test_hold_holds() -> None:
    predictor = HoldPredictor(sigma_m=0.001, speed_m_s=0.03)
    last = feed(predictor)
    found = predictor.predict([2.0], now=last)
    assert found.position[0] == pytest.approx([0.084, 0.042, 0.1])
    assert found.covariance[0, 0, 0] == pytest.approx(0.001**2 + 0.06**2)


def test_headings_go_on_through_half_a_turn() -> None:
    predictor = KalmanPredictor()
    for index in range(30):
        predictor.update(0.2 * index, [0.0, 0.0, 0.0], wrapped(2.0 + 0.4 * 0.2 * index))
    found = predictor.predict([0.0, 1.0])
    assert found.yaw == pytest.approx([wrapped(2.0 + 0.4 * 5.8), wrapped(2.0 + 0.4 * 6.8)], abs=5e-3)
    assert found.yaw_rate == pytest.approx([0.4, 0.4], abs=5e-3)
    assert predictor.update(6.0, [0.0, 0.0, 0.0], math.nan) is Update.TAKEN
    assert predictor.predict([0.0]).yaw == pytest.approx([wrapped(2.0 + 0.4 * 6.0)], abs=5e-3)


def test_the_thesis_keeps_the_heading() -> None:
    tracker = YawTracker(turns=False)
    for index in range(5):
        tracker.update(float(index), 0.3 * index)
    yaw, _, rate = tracker.predict(np.array([9.0]))
    assert yaw == pytest.approx([1.2])
    assert rate == pytest.approx([0.0])


@given(angle=st.floats(-50, 50))
def test_a_wrapped_angle_is_the_same_direction(angle: float) -> None:
    assert -math.pi < wrapped(angle) <= math.pi
    assert math.cos(wrapped(angle) - angle) == pytest.approx(1.0)
    assert wrapped(-math.pi) == math.pi


def test_unknown_names_are_refused() -> None:
    with pytest.raises(PredictionError, match="unknown predictor 'kallman'; did you mean 'kalman'"):
        make_predictor("kallman")
    with pytest.raises(CheckpointError, match="unknown weights 'mlp_lineal'"):
        MLPPredictor("mlp_lineal")
