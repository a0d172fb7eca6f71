"""The reinforcement losses of an agent, from settings."""

from __future__ import annotations

from typing import Any

from tr_grasp.configs import AlgorithmCfg, TrainCfg
from tr_grasp.modules.agent import Agent
from tr_grasp.modules.losses import (
    EncodedDDPGLoss,
    EncodedSACLoss,
    EncodedTD3Loss,
    EncodedTQCLoss,
    SharedEncoderLoss,
)

TARGET_NOISE_CLIP = 0.5


def build_loss(cfg: TrainCfg, agent: Agent) -> SharedEncoderLoss:
    """The reinforcement losses of an agent; encoder and actor stay the agent's own parameters."""
    algorithm = cfg.algorithm
    loss_class, settings = _loss_class(algorithm)
    loss = loss_class(
        agent.encoder,
        agent.actor,
        list(agent.critics),
        encoder_grad=algorithm.encoder_grad,
        critic_reduction=algorithm.critic_reduction,
        normalise_actor_loss=algorithm.normalise_actor_loss,
        **settings,
    )
    loss.make_value_estimator(gamma=algorithm.gamma)
    return loss


def _loss_class(cfg: AlgorithmCfg) -> tuple[type[SharedEncoderLoss], dict[str, Any]]:
    """The algorithm's loss and the settings that it alone has."""
    entropy = {"alpha_init": cfg.alpha_init, "min_alpha": cfg.alpha_min, "target_entropy": cfg.target_entropy}
    if cfg.name == "tqc":
        return EncodedTQCLoss, entropy | {"top_quantiles_to_drop_per_net": cfg.dropped_quantiles}
    # The papers' squared error; TorchRL's own choice is a Huber loss for some and this for others.
    squared = {"loss_function": "l2"}
    if cfg.name == "sac":
        return EncodedSACLoss, entropy | squared
    if cfg.name == "td3":
        smoothing = {"bounds": (-1.0, 1.0), "policy_noise": cfg.target_noise, "noise_clip": TARGET_NOISE_CLIP}
        return EncodedTD3Loss, smoothing | squared
    return EncodedDDPGLoss, squared
