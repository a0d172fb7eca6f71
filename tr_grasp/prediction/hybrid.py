"""The filter bank, corrected by a network that has seen many motions and knows how wrong the sum will be."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from tr_grasp.errors import CheckpointError
from tr_grasp.prediction.harmonic import BankCfg, HarmonicBankPredictor
from tr_grasp.prediction.kalman import ConstantVelocityPredictor, KalmanCfg, KalmanPredictor
from tr_grasp.prediction.networks import PERIOD_S, ResidualNet
from tr_grasp.prediction.predictor import Array, Extrapolation, GateCfg, Predictor
from tr_grasp.prediction.weights import fill, load_weights
from tr_grasp.prediction.window import Window, even_times

PAST_N = 10
"""Past positions that the network sees, 0.2 s apart."""
LENGTH_M = 0.05
"""Unit of the lengths that it sees."""
SLOWEST_M_S = 2e-3
"""Below this speed the direction of travel says nothing."""
FINEST_M = 1e-4
FURTHEST_S = 3.0
"""Longest horizon that it was trained for; beyond, the filters mix as at that horizon and the deviation grows on."""
TRAINED_WITH = BankCfg()
"""Bank that the shipped weights correct; whoever changes it has to train them again."""
_BORDERS_RAD_S = (0.2, 0.5, 1.0)


@dataclass(frozen=True, eq=False)
class Situation:
    """What the network sees and corrects, at n horizons.

    Positions are relative to the last measurement, in a frame whose first axis points where the target goes; so the
    correction does not depend on where the base is.
    """

    features: Array
    """(n, features)."""
    candidates: Array
    """(n, 3, 3) Positions that bank, constant acceleration and constant velocity expect."""
    velocities: Array
    """(n, 3, 3) Their velocities."""
    scale: Array
    """(n,) Deviation that the filters admit, with their disagreement [m]."""
    R_base_travel: Array
    """(3, 3) That frame in the one of the measurements."""
    origin: Array
    """(3,) The last measurement."""


class HybridPredictor(Predictor):
    """A harmonic bank, a constant-acceleration and a constant-velocity filter, mixed and corrected by a small network.

    The correction is at most as long as the deviation that the filters admit, so what they agree on stays. The
    covariance is the network's, scaled on validation data so that 95 % of the truth lies in its 95 % ellipsoid.

    Args:
        weights: Shipped ones (``hybrid``) or a file; None runs the filters untrained, as training does.
        bank: Settings of the bank; :data:`TRAINED_WITH` by default.
        gate: What counts as a leap.

    Raises:
        CheckpointError: No such weights, or foreign or damaged ones.
    """

    def __init__(
        self, weights: str | Path | None = "hybrid", bank: BankCfg = TRAINED_WITH, gate: GateCfg | None = None
    ) -> None:
        super().__init__(gate)
        self.bank = HarmonicBankPredictor(bank)
        self._filters: tuple[Predictor, ...] = (
            self.bank,
            KalmanPredictor(KalmanCfg(density=1e-4)),
            ConstantVelocityPredictor(KalmanCfg(density=1e-5)),
        )
        self._window = Window(span_s=PAST_N * PERIOD_S + 0.5)
        self.network, self.inflation = ResidualNet(features_n()).eval(), 1.0
        if weights is not None:
            tensors, settings = load_weights(weights, "hybrid")
            fill(self.network, tensors, weights)
            self.inflation = _inflation(settings, weights)

    def situation(self, ahead_s: Array) -> Situation:
        """What the network sees, (n,) times ahead of the last measurement."""
        found = [each._extrapolate(ahead_s) for each in self._filters]
        R_base_travel = _travel_frame(self.bank._extrapolate(np.zeros(1)).velocity[0])
        origin = self._measured
        candidates = np.stack([(each.position - origin) @ R_base_travel for each in found], 1)
        velocities = np.stack([each.velocity @ R_base_travel for each in found], 1)
        admitted = np.trace(found[0].covariance, axis1=1, axis2=2) / 3
        apart = ((candidates[:, 1] - candidates[:, 0]) ** 2).sum(-1) / 9
        scale = np.sqrt(admitted + apart + FINEST_M**2)
        past = self._window.at(even_times(self._clock, PAST_N + 1, PERIOD_S)[:-1])
        common = np.concatenate([((past - origin) @ R_base_travel).ravel() / LENGTH_M, self._opinion()])
        features = np.concatenate(
            [
                np.tile(common, (len(ahead_s), 1)),
                candidates.reshape(len(ahead_s), 9) / LENGTH_M,
                np.log(np.stack([scale, np.sqrt(admitted) + FINEST_M, np.sqrt(apart) + FINEST_M], -1)),
                np.stack([ahead_s, ahead_s**2], -1),
            ],
            -1,
        )
        return Situation(features, candidates, velocities, scale, R_base_travel, origin)

    def _begin(self, measured: Array) -> None:
        for each in self._filters:
            each._begin(measured)
        self._clock, self._taken_n, self._measured = 0.0, 1, measured
        self._window.clear()
        self._window.add(0.0, measured)

    def _take(self, elapsed_s: float, measured: Array) -> None:
        for each in self._filters:
            each._take(elapsed_s, measured)
        self._clock += elapsed_s
        self._taken_n += 1
        self._measured = measured
        self._window.add(self._clock, measured)

    @torch.no_grad()
    def _extrapolate(self, ahead_s: Array) -> Extrapolation:
        seen = self.situation(ahead_s)
        known = self.situation(np.minimum(ahead_s, FURTHEST_S)) if ahead_s.max() > FURTHEST_S else seen
        outputs = self.network(torch.from_numpy(known.features).float())
        gate, residual, spread = (output.double().numpy() for output in outputs)
        scale = seen.scale[:, None]
        position = (gate[..., None] * seen.candidates).sum(1) + scale * residual
        velocity = (gate[..., None] * seen.velocities).sum(1)
        variances = np.square(self.inflation * scale * np.exp(spread))
        R = seen.R_base_travel
        covariance = (R * variances[:, None]) @ R.T
        return Extrapolation(seen.origin + position @ R.T, covariance, velocity @ R.T)

    def _opinion(self) -> Array:
        """What the bank thinks of the motion (14,): noise levels, kinds of models, surprise, age."""
        weights = self.bank.weights.reshape(self.bank.models.levels_n, -1)
        noise, kinds = weights.sum(1), weights.sum(0)
        frequencies = self.bank.models.frequencies
        group = np.searchsorted(_BORDERS_RAD_S, frequencies)
        swings = [kinds[: len(frequencies)][group == index].sum() for index in range(len(_BORDERS_RAD_S) + 1)]
        others = kinds[len(frequencies) :]
        cv_n = len(self.bank.cfg.velocity_densities)
        masses = np.array([*noise, *swings, others[:cv_n].sum(), others[cv_n:].sum()])
        age = [self.bank.surprise, self._clock + PERIOD_S, self._taken_n, (self._clock + PERIOD_S) / self._taken_n]
        return np.concatenate([np.log10(masses + 1e-3), np.log(np.array(age) + 1e-3)])


def features_n() -> int:
    """Inputs of the network, with the default levels of noise."""
    return 3 * PAST_N + len(TRAINED_WITH.sigmas_m) + len(_BORDERS_RAD_S) + 3 + 4 + 9 + 3 + 2


def _travel_frame(velocity: Array) -> Array:
    """Rotation (3, 3) about the vertical whose first axis points along a velocity (3,)."""
    speed = np.hypot(velocity[0], velocity[1])
    x, y = (1.0, 0.0) if speed < SLOWEST_M_S else velocity[:2] / speed
    return np.array([[x, -y, 0.0], [y, x, 0.0], [0.0, 0.0, 1.0]])


def _inflation(settings: dict[str, object], source: str | Path) -> float:
    value = settings.get("inflation")
    if not isinstance(value, int | float) or not 0 < value < 100:
        raise CheckpointError(f"the weights '{source}' have no inflation of the covariance between 0 and 100.")
    return float(value)
