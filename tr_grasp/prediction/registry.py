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

SHIPPED = "{name}"
"""Where weights are, given their name: those that come with the package."""

PREDICTORS: dict[str, Callable[[str, str], Predictor]] = {
    "hold": lambda motion, weights: HoldPredictor(),
    "constant_velocity": lambda motion, weights: ConstantVelocityPredictor(),
    "kalman_thesis": lambda motion, weights: KalmanPredictor(KalmanCfg.thesis()),
    "kalman": lambda motion, weights: KalmanPredictor(),
    "mlp": lambda motion, weights: MLPPredictor(weights.replace("{name}", f"mlp_{motion}")),
    "lstm": lambda motion, weights: LSTMPredictor(weights.replace("{name}", f"lstm_{motion}")),
    "harmonic_bank": lambda motion, weights: HarmonicBankPredictor(),
    "hybrid": lambda motion, weights: HybridPredictor(weights.replace("{name}", "hybrid")),
}
"""Every predictor, given the class of motion and where weights are; only the thesis' networks need the class."""

NEAREST_CLASS = {
    "circular": "circular",
    "bezier": "circular",
    "random_turns": "circular",
    "sinusoidal": "sinusoidal",
    "two_tone": "sinusoidal",
}
"""Class of the thesis' networks that is nearest to a motion; linear for all others."""


def make_predictor(name: str, motion_class: str = "linear", weights: str = SHIPPED) -> Predictor:
    """A predictor in :data:`PREDICTORS`, with its default settings.

    Args:
        name: Of the predictor.
        motion_class: What mlp and lstm were trained for.
        weights: Where they are, ``{name}`` standing for mlp_linear and the like: ``runs/{name}.safetensors``.

    Raises:
        PredictionError: No such predictor or class.
        CheckpointError: No such weights, or foreign or damaged ones.
    """
    if name not in PREDICTORS:
        raise PredictionError(unknown_name("predictor", name, PREDICTORS))
    if motion_class not in THESIS_MOTIONS:
        raise PredictionError(unknown_name("class of motion", motion_class, THESIS_MOTIONS))
    return PREDICTORS[name](motion_class, weights)
