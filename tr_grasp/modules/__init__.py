"""Networks and losses: encoders, heads, agents, reinforcement, imitation, saved policies."""

from tr_grasp.modules.agent import Agent, EnvSpec, build_agent
from tr_grasp.modules.algorithms import build_loss
from tr_grasp.modules.encoders import (
    ImageCNN,
    LocalisingOCNN,
    OAHRNet,
    OctreeAttention,
    PointNet,
    ResidualOCNN,
    StackedEncoder,
    StateMLP,
    VanillaOCNN,
    build_encoder,
    rgbd_image,
)
from tr_grasp.modules.heads import (
    DenseResidualMLP,
    DeterministicActor,
    DuelingQuantileCritic,
    GaussianActor,
    QuantileCritic,
    SpectralNorm,
)
from tr_grasp.modules.imitation import imitation_loss
from tr_grasp.modules.losses import EncodedDDPGLoss, EncodedSACLoss, EncodedTD3Loss, EncodedTQCLoss, TargetUpdate
from tr_grasp.modules.policy_io import load_agent, load_policy, save_policy, shipped_policies

__all__ = [
    "Agent",
    "DenseResidualMLP",
    "DeterministicActor",
    "DuelingQuantileCritic",
    "EncodedDDPGLoss",
    "EncodedSACLoss",
    "EncodedTD3Loss",
    "EncodedTQCLoss",
    "EnvSpec",
    "GaussianActor",
    "ImageCNN",
    "LocalisingOCNN",
    "OAHRNet",
    "OctreeAttention",
    "PointNet",
    "QuantileCritic",
    "ResidualOCNN",
    "SpectralNorm",
    "StackedEncoder",
    "StateMLP",
    "TargetUpdate",
    "VanillaOCNN",
    "build_agent",
    "build_encoder",
    "build_loss",
    "imitation_loss",
    "load_agent",
    "load_policy",
    "rgbd_image",
    "save_policy",
    "shipped_policies",
]
