"""Reinforcement losses on the features of an encoder that actor and critics share."""

from tr_grasp.modules.losses.deterministic import EncodedDDPGLoss, EncodedTD3Loss
from tr_grasp.modules.losses.shared_encoder import EncoderGrad, SharedEncoderLoss
from tr_grasp.modules.losses.stochastic import EncodedSACLoss, EncodedTQCLoss
from tr_grasp.modules.losses.targets import TargetUpdate

__all__ = [
    "EncodedDDPGLoss",
    "EncodedSACLoss",
    "EncodedTD3Loss",
    "EncodedTQCLoss",
    "EncoderGrad",
    "SharedEncoderLoss",
    "TargetUpdate",
]
