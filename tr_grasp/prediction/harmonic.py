"""A bank of filters, each with another idea of the motion, weighted by how well each foresaw the measurements."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from tr_grasp.errors import PredictionError
from tr_grasp.prediction.kalman import transition, white_noise
from tr_grasp.prediction.predictor import Array, Extrapolation, GateCfg, Predictor

STATES_N = 4
Indices = NDArray[np.intp]
NEGLIGIBLE = 1e-4
TINY = 1e-300
SURPRISE_RATE = 0.1
LARGEST_SURPRISE = 10.0


@dataclass(frozen=True)
class BankCfg:
    """Models of a harmonic filter bank.

    Every model comes once for every level of measurement noise, so that the noise need not be known.
    """

    slowest_rad_s: float = 0.03
    """One oscillator far below the others, for arcs that hardly bend."""
    range_rad_s: tuple[float, float] = (0.1, 2.56)
    """Slowest and fastest of the other oscillators. The benchmark's sine has 1.9 rad/s at 10 cm/s."""
    oscillators_n: int = 70
    """How many of those, evenly on a logarithmic scale."""
    sigmas_m: tuple[float, ...] = (1e-4, 1e-3, 3e-3)
    """Levels of measurement noise, standard deviations."""
    line_density: float = 1e-8
    """White acceleration of the line under an oscillation [m²/s³]."""
    oscillator_density: float = 1e-6
    """White acceleration of the oscillation, however narrow it is [m²/s³]."""
    detuning: float = 1.0
    """Part of the white acceleration that a frequency between two oscillators amounts to; 0 leaves it out."""
    velocity_densities: tuple[float, ...] = (1e-8, 1e-5)
    """White acceleration of the models of constant velocity [m²/s³]; none leaves them out."""
    acceleration_densities: tuple[float, ...] = (1e-6, 1e-4, 1e-2)
    """White jerk of the models of constant acceleration [m²/s⁵]; none leaves them out."""
    amplitude_m: float = 0.15
    """Typical amplitude of an oscillation."""
    speed_m_s: float = 0.1
    """Typical speed."""
    acceleration_m_s2: float = 0.1
    """Typical acceleration of the models of constant acceleration."""
    memory: float = 0.999
    """Share of a model's evidence that is left after one more measurement."""
    switching: float = 1e-3
    """Probability that another model takes over between two measurements."""


class HarmonicBankPredictor(Predictor):
    """Line plus oscillation at 71 frequencies, constant velocity and constant acceleration, mixed by their likelihood.

    Each model is a Kalman filter with four states a axis; the axes share one covariance. A circle, a line and a sine on
    a line are among the models; no training. Off its models (a turn, a start) constant acceleration takes over, because
    the weights never fall to nothing; and the covariance grows with the surprise of the last second or two.

    Args:
        cfg: Models.
        gate: What counts as a leap.

    Raises:
        PredictionError: No model, or a setting out of its range.
    """

    def __init__(self, cfg: BankCfg | None = None, gate: GateCfg | None = None) -> None:
        super().__init__(gate)
        self.cfg = cfg or BankCfg()
        self.models = _Models(self.cfg)

    @property
    def weights(self) -> Array:
        """(models,) Probability of every model; those of one noise level follow each other."""
        weights = np.exp(self._evidence - self._evidence.max())
        return weights / weights.sum()

    @property
    def surprise(self) -> float:
        """Running mean of the squared innovation in units of its variance, for one axis; 1 if the bank knows itself."""
        return self._surprise

    def _begin(self, measured: Array) -> None:
        self._x = np.zeros((self.models.n, STATES_N, 3))
        self._x[:, 0] = measured
        self._P = self.models.start_covariance.copy()
        self._evidence = np.zeros(self.models.n)
        self._surprise = 1.0

    def _take(self, elapsed_s: float, measured: Array) -> None:
        F, Q = self.models.step(round(elapsed_s, 9))
        Q = self.models.disturbed(Q, self._x)
        x, P = F @ self._x, F @ self._P @ F.swapaxes(-1, -2) + Q
        PH = (P @ self.models.H[..., None])[..., 0]
        S = (PH * self.models.H).sum(-1) + self.models.variance
        innovation = measured - (self.models.H[:, :, None] * x).sum(1)
        self._weigh(innovation, S)
        gain = PH / S[:, None]
        self._x = x + gain[..., None] * innovation[:, None]
        self._P = P - gain[..., None] * PH[:, None]

    def _weigh(self, innovation: Array, S: Array) -> None:
        """Compare what came with what every model foresaw: innovations (models, 3), variances (models,)."""
        weights, level = self.weights, innovation[:, :2]
        mean = weights @ level
        variance = weights @ (S + ((level - mean) ** 2).sum(-1) / 2)
        self._surprise += SURPRISE_RATE * (min(float(mean @ mean / variance / 2), LARGEST_SURPRISE) - self._surprise)
        prior = (1 - self.cfg.switching) * weights + self.cfg.switching / self.models.n
        # A height that hardly changes fits every model, the slow ones best; so only the plane is evidence.
        fit = -0.5 * (level**2).sum(-1) / S - np.log(S)
        self._evidence = self.cfg.memory * np.log(prior + TINY) + fit

    def _extrapolate(self, ahead_s: Array) -> Extrapolation:
        weights = self.weights
        chosen = np.flatnonzero(weights > NEGLIGIBLE)
        weights = weights[chosen] / weights[chosen].sum()
        F, Q = self.models.ahead(ahead_s, chosen)
        H, x, P = self.models.H[chosen], self._x[chosen], self._P[chosen]
        Q = self.models.disturbed(Q, x, chosen)
        HF = (H[:, None] @ F)[..., 0, :]
        means = np.einsum("hms,msa->hma", HF, x)
        variances = np.einsum("hms,mst,hmt->hm", HF, P, HF) + np.einsum("ms,hmst,mt->hm", H, Q, H)
        position = np.einsum("m,hma->ha", weights, means)
        apart = means - position[:, None]
        covariance = np.einsum("m,hma,hmb->hab", weights, apart, apart)
        covariance += (variances @ weights)[:, None, None] * np.eye(3)
        rate = np.einsum("ms,hmst,mta->hma", self.models.H_rate[chosen], F, x)
        return Extrapolation(position, covariance * max(1.0, self._surprise), np.einsum("m,hma->ha", weights, rate))


class _Models:
    """Matrices of all models: oscillators, then constant velocity, then constant acceleration, for each noise level."""

    def __init__(self, cfg: BankCfg) -> None:
        if not (cfg.slowest_rad_s > 0 and 0 < cfg.range_rad_s[0] <= cfg.range_rad_s[1] and cfg.oscillators_n > 0):
            raise PredictionError(f"the frequencies of a bank must be positive and rise, got {cfg}.")
        if not cfg.sigmas_m or min(cfg.sigmas_m) <= 0 or not 0 < cfg.memory <= 1 or not 0 <= cfg.switching < 1:
            raise PredictionError(f"noise levels must be positive, memory and switching in [0, 1], got {cfg}.")
        self.cfg = cfg
        self.frequencies = np.concatenate([[cfg.slowest_rad_s], np.geomspace(*cfg.range_rad_s, cfg.oscillators_n)])
        self.kinds = ["oscillator"] * len(self.frequencies)
        self.kinds += ["velocity"] * len(cfg.velocity_densities) + ["acceleration"] * len(cfg.acceleration_densities)
        self.one_level_n, self.levels_n = len(self.kinds), len(cfg.sigmas_m)
        self.n = self.one_level_n * self.levels_n
        self.variance = np.repeat(np.square(cfg.sigmas_m), self.one_level_n)
        self.step = lru_cache(maxsize=256)(self._step)

    @cached_property
    def H(self) -> Array:
        """(n, 4) What of the state is the position."""
        return np.array([[1.0, 0, kind == "oscillator", 0] for kind in self.kinds] * self.levels_n)

    @cached_property
    def H_rate(self) -> Array:
        """(n, 4) What of the state is the velocity."""
        return np.array([[0, 1.0, 0, kind == "oscillator"] for kind in self.kinds] * self.levels_n)

    @cached_property
    def start_covariance(self) -> Array:
        """(n, 4, 4) What is known after one measurement."""
        cfg = self.cfg
        rows = [[cfg.amplitude_m, cfg.speed_m_s, cfg.amplitude_m, cfg.amplitude_m * w] for w in self.frequencies]
        rows += [[0.0, cfg.speed_m_s, 0.0, 0.0]] * len(cfg.velocity_densities)
        rows += [[0.0, cfg.speed_m_s, cfg.acceleration_m_s2, 0.0]] * len(cfg.acceleration_densities)
        P = np.array([np.diag(np.square(row)) for row in rows] * self.levels_n)
        # Offset and oscillation are free, their sum is what was measured.
        PH = (P @ self.H[..., None])[..., 0]
        known = PH[:, :, None] * PH[:, None] / ((PH * self.H).sum(-1) + self.variance)[:, None, None].clip(1e-300)
        P = P - known
        P[:, 0, 0] += np.where(self.H[:, 2] == 0, self.variance, 0.0)
        return P

    @cached_property
    def detuning(self) -> Array:
        """(n,) White acceleration [m²/s³] for each square metre of amplitude, 0 for what does not swing.

        A frequency is a share e of itself away from the nearest oscillator, on average a quarter of their spacing. That
        amounts to an acceleration of 2 e w² x, whose square is 2 e² w⁴ on average for an amplitude of 1 m, and which
        keeps its sign for about 1 / w.
        """
        low, high = self.cfg.range_rad_s
        share = np.log(high / low) / max(1, self.cfg.oscillators_n - 1) / 4
        return np.where(self.H[:, 2] == 1, self.cfg.detuning * 2 * share**2 * self.radians_s**3, 0.0)

    @cached_property
    def radians_s(self) -> Array:
        """(n,) Frequency, 1 for what does not swing."""
        others = np.ones(self.one_level_n - len(self.frequencies))
        return np.tile(np.concatenate([self.frequencies, others]), self.levels_n)

    def disturbed(self, Q: Array, x: Array, chosen: Indices | slice = slice(None)) -> Array:
        """Process noise (..., chosen, 4, 4) of the states (chosen, 4, 3): the wider a swing, the more."""
        squares = x[:, 2, :2] ** 2 + (x[:, 3, :2] / self.radians_s[chosen, None]) ** 2
        density = self.density[chosen] + self.detuning[chosen] * squares.mean(-1)
        Q = Q.copy("K")
        Q[..., 2:, 2:] *= density[:, None, None]
        return Q

    @cached_property
    def density(self) -> Array:
        """(n,) White acceleration of a swing that is not wide yet [m²/s³]; 1 for what does not swing."""
        return np.where(self.H[:, 2] == 1, self.cfg.oscillator_density, 1.0)

    def _step(self, dt: float) -> tuple[Array, Array]:
        F, Q = self.ahead(np.array([dt]), np.arange(self.n))
        return F[0], Q[0]

    def ahead(self, times: Array, chosen: Indices) -> tuple[Array, Array]:
        """Transitions and process noise (times, chosen, 4, 4) over each time [s], that of swings for a density of 1."""
        F, Q = self._one_level(times)
        return F[:, chosen % self.one_level_n], Q[:, chosen % self.one_level_n]

    def _one_level(self, times: Array) -> tuple[Array, Array]:
        cfg, n = self.cfg, len(self.frequencies)
        F = np.zeros((len(times), self.one_level_n, STATES_N, STATES_N))
        Q = np.zeros_like(F)
        F[:, :n, 2:, 2:], Q[:, :n, 2:, 2:] = oscillation(self.frequencies, times, 1.0)
        F[:, :n, :2, :2] = transition(2, times)[:, None]
        Q[:, :n, :2, :2] = white_noise(2, times, cfg.line_density)[:, None]
        for model, density in enumerate(cfg.velocity_densities, n):
            F[:, model, :2, :2], Q[:, model, :2, :2] = transition(2, times), white_noise(2, times, density)
        for model, density in enumerate(cfg.acceleration_densities, n + len(cfg.velocity_densities)):
            F[:, model, :3, :3], Q[:, model, :3, :3] = transition(3, times), white_noise(3, times, density)
        return F, Q


def oscillation(frequencies: Array, times: Array, density: float) -> tuple[Array, Array]:
    """Transition and noise (times, frequencies, 2, 2) of a swing [m, m/s] that white acceleration disturbs."""
    w, t = frequencies[None], times[:, None]
    phase = w * t
    sine, cosine = np.sin(phase), np.cos(phase)
    F = np.stack([np.stack([cosine, sine / w], -1), np.stack([-w * sine, cosine], -1)], -2)
    half, double = t / 2, np.sin(2 * phase) / (4 * w)
    cross = sine**2 / (2 * w**2)
    Q = np.stack([np.stack([(half - double) / w**2, cross], -1), np.stack([cross, half + double], -1)], -2)
    return F, density * Q
