"""What sits on the encoder's features: actors, critics, and the networks inside them."""

from tr_grasp.modules.heads.actors import LOG_STD_RANGE, DeterministicActor, GaussianActor
from tr_grasp.modules.heads.critics import DuelingQuantileCritic, OutputScale, QuantileCritic
from tr_grasp.modules.heads.dense_residual import DenseResidualMLP
from tr_grasp.modules.heads.mlp import MLP, ConcatLinear, mlp
from tr_grasp.modules.heads.spectral_norm import SpectralNorm, normalise_kernels

__all__ = [
    "LOG_STD_RANGE",
    "MLP",
    "ConcatLinear",
    "DenseResidualMLP",
    "DeterministicActor",
    "DuelingQuantileCritic",
    "GaussianActor",
    "OutputScale",
    "QuantileCritic",
    "SpectralNorm",
    "mlp",
    "normalise_kernels",
]
