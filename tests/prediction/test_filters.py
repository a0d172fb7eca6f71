"""Kalman filters against the textbook's formulas, and the bank against what it is made for."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tr_grasp.errors import PredictionError
from tr_grasp.prediction import BankCfg, ConstantVelocityPredictor, HarmonicBankPredictor, KalmanCfg, KalmanPredictor
from tr_grasp.prediction.harmonic import oscillation
from tr_grasp.prediction.kalman import on_three_axes, transition, white_noise


class Textbook:
    """A linear Kalman filter, every matrix written out, Joseph's form."""

    def __init__(self, first: np.ndarray, cfg: KalmanCfg) -> None:
        self.x, self.P = np.r_[first, np.zeros(6)], np.diag(np.repeat(np.square(cfg.start_sigmas), 3))
        self.H, self.R, self.cfg = np.eye(3, 9), cfg.sigma_m**2 * np.eye(3), cfg

    def matrices(self, dt: float) -> tuple[np.ndarray, np.ndarray]:
        F, Q, q = np.eye(9), np.zeros((9, 9)), self.cfg.density
        for axis in range(3):
            p, v, a = axis, axis + 3, axis + 6
            F[p, v] = F[v, a] = dt
            F[p, a] = dt**2 / 2
            block = [
                [dt**5 / 20, dt**4 / 8, dt**3 / 6],
                [dt**4 / 8, dt**3 / 3, dt**2 / 2],
                [dt**3 / 6, dt**2 / 2, dt],
            ]
            Q[np.ix_([p, v, a], [p, v, a])] = q * np.array(block)
        if self.cfg.process == "thesis":
            Q[:] = 0.0
            Q[:6, :6] = 0.05
        return F, Q

    def update(self, dt: float, z: np.ndarray) -> None:
        F, Q = self.matrices(dt)
        x, P = F @ self.x, F @ self.P @ F.T + Q
        K = P @ self.H.T @ np.linalg.inv(self.H @ P @ self.H.T + self.R)
        rest = np.eye(9) - K @ self.H
        self.x, self.P = x + K @ (z - self.H @ x), rest @ P @ rest.T + K @ self.R @ K.T


@pytest.mark.parametrize("cfg", [KalmanCfg.thesis(), KalmanCfg(), KalmanCfg(density=1e-2, sigma_m=3e-3)])
@given(seed=st.integers(0, 1000))
@settings(max_examples=5)
def test_the_filter_is_the_textbook_s(cfg: KalmanCfg, seed: int) -> None:
    rng = np.random.default_rng(seed)
    times = np.cumsum(rng.uniform(0.05, 0.5, 25))
    positions = np.cumsum(rng.normal(0, 5e-3, (25, 3)), 0)
    ours, reference = KalmanPredictor(cfg), Textbook(positions[0], cfg)
    ours.update(times[0], positions[0])
    for before, t, z in zip(times, times[1:], positions[1:], strict=False):
        ours.update(t, z)
        reference.update(t - before, z)
    F, Q = reference.matrices(1.3)
    found, P = ours.predict([1.3]), F @ reference.P @ F.T + Q
    assert np.allclose(found.position[0], (F @ reference.x)[:3], atol=1e-8)
    assert np.allclose(found.covariance[0], P[:3, :3], atol=1e-8, rtol=1e-6)
    assert np.allclose(found.velocity[0], (F @ reference.x)[3:6], atol=1e-8)


def test_one_step_of_the_constant_velocity_filter_by_hand() -> None:
    # Start at 0 with sigmas 1 and 1, no process noise to speak of; after 1 s the position is known to 2 m²; R is 2 m².
    filter_ = ConstantVelocityPredictor(KalmanCfg(density=1e-12, sigma_m=2**0.5, start_sigmas=(1.0, 1.0, 1.0)))
    filter_.gate = filter_.gate.__class__(top_speed_m_s=100.0)
    filter_.update(0.0, [0.0, 0.0, 0.0])
    filter_.update(1.0, [4.0, 0.0, 0.0])
    found = filter_.predict([0.0, 2.0])
    # Gain 2/4 for the position, 1/4 for the velocity.
    assert found.position[:, 0] == pytest.approx([2.0, 4.0])
    assert found.velocity[0, 0] == pytest.approx(1.0)
    assert found.covariance[0, 0, 0] == pytest.approx(1.0)


@given(first=st.floats(0.01, 2), second=st.floats(0.01, 2), order=st.integers(2, 3))
def test_two_steps_are_one_long_step(first: float, second: float, order: int) -> None:
    F, Q = transition(order, second), white_noise(order, second, 0.7)
    whole = F @ white_noise(order, first, 0.7) @ F.T + Q
    assert np.allclose(F @ transition(order, first), transition(order, first + second))
    assert np.allclose(whole, white_noise(order, first + second, 0.7))


@given(first=st.floats(0.01, 2), second=st.floats(0.01, 2), frequency=st.floats(0.05, 3))
def test_two_swings_are_one_long_swing(first: float, second: float, frequency: float) -> None:
    (F1, F2, F), (Q1, Q2, Q) = (
        m[:, 0] for m in oscillation(np.array([frequency]), np.array([first, second, first + second]), 0.7)
    )
    assert np.allclose(F2 @ F1, F)
    assert np.allclose(F2 @ Q1 @ F2.T + Q2, Q, atol=1e-9)


def test_three_axes_are_a_kronecker_product() -> None:
    matrices = np.random.default_rng(0).normal(size=(2, 3, 3))
    assert np.array_equal(on_three_axes(matrices), [np.kron(m, np.eye(3)) for m in matrices])


@pytest.mark.parametrize("radius_m", [0.3, 0.6])
def test_the_bank_foresees_a_circle(radius_m: float) -> None:
    bank = HarmonicBankPredictor()
    rate = 0.03 / radius_m

    def there(t: float) -> np.ndarray:
        return np.array([radius_m * np.cos(rate * t), radius_m * np.sin(rate * t), 0.1])

    for index in range(60):
        bank.update(0.2 * index, there(0.2 * index))
    found = bank.predict([2.0])
    assert np.linalg.norm(found.position[0] - there(13.8)) < 4e-3
    assert np.linalg.norm(there(11.8) - there(13.8)) > 0.05


def test_the_bank_finds_the_frequency_of_a_sine() -> None:
    bank, w = HarmonicBankPredictor(BankCfg(sigmas_m=(1e-4,))), 0.57

    def there(t: float) -> np.ndarray:
        return np.array([0.125 * np.sin(w * t), 0.03 * t, 0.1])

    for index in range(60):
        bank.update(0.2 * index, there(0.2 * index))
    assert np.linalg.norm(bank.predict([2.0]).position[0] - there(13.8)) < 0.015
    swings = bank.weights[: len(bank.models.frequencies)]
    assert swings.sum() > 0.9
    assert bank.models.frequencies[swings.argmax()] == pytest.approx(w, rel=0.08)


def test_a_wide_sine_between_two_frequencies_of_the_bank_is_foreseen_all_along() -> None:
    """Such a sine of 0.3 m runs away from both after some seconds: by half a metre, were its width of no account."""
    bank = HarmonicBankPredictor()
    w = np.sqrt(np.prod(bank.models.frequencies[[47, 48]]))
    times = 0.2 * np.arange(90)
    there = np.stack([0.3 * np.sin(w * times), 0.05 * times, np.full(90, 0.1)], -1)
    errors = []
    for index in range(80):
        bank.update(times[index], there[index])
        if index >= 25:
            errors.append(np.linalg.norm(bank.predict([2.0]).position[0] - there[index + 10]))
    assert max(errors) < 0.05


def test_the_noise_of_a_swing_grows_with_the_square_of_its_amplitude() -> None:
    """By hand: 0.2 m on one of two axes at 1 rad/s, three frequencies a factor of 1.1 apart."""
    models = HarmonicBankPredictor(BankCfg(range_rad_s=(1.0, 1.21), oscillators_n=3)).models
    x = np.zeros((models.n, 4, 3))
    x[1, 2, 0] = 0.2
    _, Q = models.ahead(np.array([0.4]), np.arange(models.n))
    added = models.disturbed(Q, x)[0, 1] - models.disturbed(Q, 0 * x)[0, 1]
    share = np.log(1.1) / 4
    expected = oscillation(np.array([1.0]), np.array([0.4]), 2 * share**2 * 0.2**2 / 2)[1][0, 0]
    assert np.allclose(added[2:, 2:], expected, atol=1e-12)
    assert not added[:2].any()
    # A swing in passing has the same amplitude, and constant acceleration has none.
    passing = np.zeros_like(x)
    passing[1, 3, 0] = 0.2
    passing[-1, 2, 0] = 0.2
    assert np.allclose(models.disturbed(Q, passing)[0, 1], models.disturbed(Q, x)[0, 1])
    assert np.array_equal(models.disturbed(Q, passing)[0, -1], Q[0, -1])


def test_the_weights_of_the_bank_are_probabilities() -> None:
    bank, rng = HarmonicBankPredictor(), np.random.default_rng(0)
    for index in range(30):
        bank.update(0.1 * index, rng.normal(0, 5e-3, 3))
        assert bank.weights.sum() == pytest.approx(1.0)
        assert bank.weights.min() >= 0


def test_a_bank_that_is_surprised_admits_more() -> None:
    calm, surprised = HarmonicBankPredictor(), HarmonicBankPredictor()
    rng = np.random.default_rng(1)
    for index in range(40):
        calm.update(0.2 * index, [0.006 * index, 0.0, 0.0])
        kick = 0.04 * rng.choice([-1, 1], 3) if index > 25 else 0.0
        surprised.update(0.2 * index, np.array([0.006 * index, 0.0, 0.0]) + kick)
    assert np.trace(surprised.predict([1.0]).covariance[0]) > 10 * np.trace(calm.predict([1.0]).covariance[0])


@pytest.mark.parametrize(
    "make",
    [
        lambda: KalmanPredictor(KalmanCfg(sigma_m=0.0)),
        lambda: HarmonicBankPredictor(BankCfg(sigmas_m=())),
        lambda: HarmonicBankPredictor(BankCfg(range_rad_s=(2.0, 1.0))),
        lambda: HarmonicBankPredictor(BankCfg(memory=1.5)),
    ],
)
def test_impossible_settings_are_refused(make: object) -> None:
    with pytest.raises(PredictionError):
        make()  # type: ignore[operator]
