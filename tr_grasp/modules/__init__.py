"""Networks and losses: encoders, heads, agents, truncated quantile critics, imitation, saved policies."""

from tr_grasp.modules.agent import Agent, EnvSpec, build_agent, build_loss
from tr_grasp.modules.encoders import build_encoder
from tr_grasp.modules.heads import GaussianActor, QuantileCritic
from tr_grasp.modules.imitation import imitation_loss
from tr_grasp.modules.losses import EncodedTQCLoss
from tr_grasp.modules.policy_io import load_agent, load_policy, save_policy, shipped_policies

__all__ = [
    "Agent",
    "EncodedTQCLoss",
    "EnvSpec",
    "GaussianActor",
    "QuantileCritic",
    "build_agent",
    "build_encoder",
    "build_loss",
    "imitation_loss",
    "load_agent",
    "load_policy",
    "save_policy",
    "shipped_policies",
]
