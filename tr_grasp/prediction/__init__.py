"""Where a moving object will be: predictors, and the motions that they are judged on. No simulator."""

from tr_grasp.prediction.harmonic import BankCfg, HarmonicBankPredictor
from tr_grasp.prediction.hybrid import HybridPredictor
from tr_grasp.prediction.kalman import ConstantVelocityPredictor, KalmanCfg, KalmanPredictor
from tr_grasp.prediction.learned import LSTMPredictor, MLPPredictor
from tr_grasp.prediction.predictor import GateCfg, Prediction, Predictor, Update
from tr_grasp.prediction.registry import PREDICTORS, make_predictor
from tr_grasp.prediction.simple import HoldPredictor
from tr_grasp.prediction.weights import shipped_weights

__all__ = [
    "PREDICTORS",
    "BankCfg",
    "ConstantVelocityPredictor",
    "GateCfg",
    "HarmonicBankPredictor",
    "HoldPredictor",
    "HybridPredictor",
    "KalmanCfg",
    "KalmanPredictor",
    "LSTMPredictor",
    "MLPPredictor",
    "Prediction",
    "Predictor",
    "Update",
    "make_predictor",
    "shipped_weights",
]
