"""Predictors by name."""

from __future__ import annotations

from collections.abc import Callable

from tr_grasp.errors import PredictionError, unknown_name
from tr_grasp.prediction.datasets import THESIS_MOTIONS
from tr_grasp.prediction.harmonic import HarmonicBankPredictor
from tr_grasp.prediction.hybrid import HybridPredictor
from tr_grasp.prediction.kalman import ConstantVelocityPredictor, KalmanCfg, KalmanPredictor
from tr_grasp.prediction.learned import LSTMPredictor, MLPPredictor
from tr_grasp.prediction.predictor import Predictor
from tr_grasp.prediction.simple import HoldPredictor

PREDICTORS: dict[str, Callable[[str], Predictor]] = {
    "hold": lambda motion: HoldPredictor(),
    "constant_velocity": lambda motion: ConstantVelocityPredictor(),
    "kalman_thesis": lambda motion: KalmanPredictor(KalmanCfg.thesis()),
    "kalman": lambda motion: KalmanPredictor(),
    "mlp": lambda motion: MLPPredictor(f"mlp_{motion}"),
    "lstm": lambda motion: LSTMPredictor(f"lstm_{motion}"),
    "harmonic_bank": lambda motion: HarmonicBankPredictor(),
    "hybrid": lambda motion: HybridPredictor(),
}
"""Every predictor, given the class of motion; only the thesis' networks have to be told that."""

NEAREST_CLASS = {
    "circular": "circular",
    "bezier": "circular",
    "random_turns": "circular",
    "sinusoidal": "sinusoidal",
    "two_tone": "sinusoidal",
}
"""Class of the thesis' networks that is nearest to a motion; linear for all others."""


def make_predictor(name: str, motion_class: str = "linear") -> Predictor:
    """A predictor in :data:`PREDICTORS`, with its default settings and shipped weights.

    Raises:
        PredictionError: No such predictor or class.
    """
    if name not in PREDICTORS:
        raise PredictionError(unknown_name("predictor", name, PREDICTORS))
    if motion_class not in THESIS_MOTIONS:
        raise PredictionError(unknown_name("class of motion", motion_class, THESIS_MOTIONS))
    return PREDICTORS[name](motion_class)
