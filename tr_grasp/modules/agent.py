"""The networks of a policy and its critics, put together from settings."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import torch
from tensordict.nn import TensorDictModule, TensorDictSequential
from torch import Tensor, nn
from torchrl.envs.utils import ExplorationType
from torchrl.modules import ProbabilisticActor, TanhNormal, ValueOperator

from tr_grasp.configs import NetworkCfg, TrainCfg
from tr_grasp.errors import ConfigError
from tr_grasp.keys import ACTION, ACTOR_FEATURES, COLOUR_IMAGE, CRITIC_FEATURES, DEPTH_IMAGE, OCTREE, PROPRIO, STAGES
from tr_grasp.modules.encoders import build_encoder, encoder_options, rgbd_image
from tr_grasp.modules.heads import (
    DenseResidualMLP,
    DeterministicActor,
    DuelingQuantileCritic,
    GaussianActor,
    OutputScale,
    QuantileCritic,
    normalise_kernels,
)
from tr_grasp.modules.heads.mlp import MakeNet
from tr_grasp.octree import OctreeFrame, OctreeSpec


@dataclass(frozen=True)
class EnvSpec:
    """The sizes by which an environment and an agent fit each other."""

    octree: OctreeSpec
    """Cube and leaves of the observed octrees."""

    stack_n: int
    """Stacked observations, oldest first."""

    proprio_n: int = 10
    """Numbers of proprioception in each stacked observation."""

    stages_n: int = 4
    """Stage flags, seen by critics only."""

    action_n: int = 5
    """Action components, each in [-1, 1]."""

    pictures: bool = False
    """Observations hold the camera's pictures too."""


class Agent(nn.Module):
    """A policy and the critics that judge it, on one shared encoder.

    Attributes:
        encoder: TensorDict module, ``octree`` (or pictures) and ``proprio`` to ``actor_features``.
        actor: TensorDict module, ``actor_features`` to ``action``; deterministic (tanh of the mean) unless TorchRL's
            exploration type says otherwise, and always so for algorithms without a random policy.
        critics: TensorDict modules, ``critic_features``, maybe ``stages``, and ``action`` to quantiles or one value.
        policy: Encoder, then actor.
        env_spec: The sizes of the environments that it fits.
    """

    def __init__(
        self, env_spec: EnvSpec, encoder: TensorDictModule, actor: TensorDictSequential, critics: list[ValueOperator]
    ) -> None:
        super().__init__()
        self.env_spec = env_spec
        self.encoder = encoder
        self.actor = actor
        # A plain list: the loss stacks copies of the critics, these here only give the initial weights.
        self.critics = critics
        # Not registered, or every weight would have two names.
        self.__dict__["policy"] = TensorDictSequential(encoder, actor).select_out_keys(ACTION)

    policy: TensorDictSequential

    @property
    def features_n(self) -> int:
        """Features of an observation."""
        return self.encoder.module.encoder.features_n

    def mean_before_tanh(self, features: Tensor) -> Tensor:
        """``(*batch, features_n)`` to what the deterministic action is the tanh of, ``(*batch, action_n)``."""
        return self.actor.module[0].module.mean(features)


class Perception(nn.Module):
    """An encoder for any leading batch, the unbatched observation of one environment included."""

    def __init__(self, encoder: nn.Module) -> None:
        super().__init__()
        self.encoder = encoder

    def forward(self, frames: OctreeFrame | Tensor, proprio: Tensor) -> Tensor:
        """Frames ``(*batch, stack)`` and proprioception ``(*batch, stack, n)`` to features ``(*batch, features_n)``."""
        *batch, stack_n, proprio_n = proprio.shape
        rest = frames.shape[len(batch) + 1 :]  # of a picture
        features = self.encoder(frames.reshape(-1, stack_n, *rest), proprio.reshape(-1, stack_n, proprio_n))
        return features.reshape(*batch, -1)


class PicturePerception(Perception):
    """An encoder of RGB-D pictures for any leading batch."""

    def forward(self, colour_image: Tensor, depth_image: Tensor, proprio: Tensor) -> Tensor:
        """Pictures ``(*batch, stack, channels, h, w)`` and proprioception to features ``(*batch, features_n)``."""
        return super().forward(rgbd_image(colour_image, depth_image), proprio)


def build_agent(cfg: TrainCfg, env_spec: EnvSpec) -> Agent:
    """Networks with fresh weights from torch's global generator.

    Raises:
        ConfigError: An encoder that does not exist, lacks an option that is asked for, does not fit the octrees, or
            reads pictures that are not observed.
    """
    encoder = _build_encoder(cfg.network, env_spec)
    features_n = encoder.features_n
    actor = _build_actor(cfg, features_n, env_spec.action_n)
    critics = [_build_critic(cfg, features_n, env_spec) for _ in range(cfg.algorithm.critic_count)]
    return Agent(env_spec, _perception(cfg.network, encoder), actor, critics)


def _perception(net: NetworkCfg, encoder: nn.Module) -> TensorDictModule:
    if net.encoder == "image_cnn":
        read, perception = [COLOUR_IMAGE, DEPTH_IMAGE, PROPRIO], PicturePerception(encoder)
    else:
        read, perception = [OCTREE, PROPRIO], Perception(encoder)
    return TensorDictModule(perception, in_keys=read, out_keys=[ACTOR_FEATURES])


def _build_encoder(net: NetworkCfg, env_spec: EnvSpec) -> nn.Module:
    if net.encoder == "image_cnn" and not env_spec.pictures:
        raise ConfigError("image_cnn reads pictures, and these environments give none; turn observation.image on.")
    # A size that not every encoder can choose. Options that change what a network is are refused where they are none.
    size = {"features_n": net.features_n} if "features_n" in encoder_options(net.encoder) else {}
    encoder = build_encoder(
        net.encoder,
        in_channels=env_spec.octree.channels,
        stack_n=env_spec.stack_n,
        shared_stack=net.shared_stack,
        spec=env_spec.octree,
        node_set=net.node_set,
        num_blocks=net.num_blocks,
        norm=net.norm,
        **size,
    )
    if net.spectral_norm == "all":
        normalise_kernels(encoder)
    return encoder


def _build_actor(cfg: TrainCfg, features_n: int, action_n: int) -> TensorDictSequential:
    net = cfg.network
    make_net = _dense_residual(net, net.spectral_norm in ("actor_critic", "all"))
    if not cfg.algorithm.is_stochastic:
        head = DeterministicActor(features_n, action_n, net.actor_hidden_n, make_net=make_net)
        return TensorDictSequential(
            TensorDictModule(head, in_keys=[ACTOR_FEATURES], out_keys=["loc"]),
            TensorDictModule(torch.tanh, in_keys=["loc"], out_keys=[ACTION]),
        )
    head = GaussianActor(features_n, action_n, net.actor_hidden_n, net.log_std_init, make_net=make_net)
    return ProbabilisticActor(
        TensorDictModule(head, in_keys=[ACTOR_FEATURES], out_keys=["loc", "scale"]),
        in_keys=["loc", "scale"],
        out_keys=[ACTION],
        distribution_class=TanhNormal,
        default_interaction_type=ExplorationType.DETERMINISTIC,
    )


def _build_critic(cfg: TrainCfg, features_n: int, env_spec: EnvSpec) -> ValueOperator:
    net = cfg.network
    is_scaled = net.learn_output_scale or net.output_scale != 1
    make_critic = DuelingQuantileCritic if net.heads in ("dueling", "advanced") else QuantileCritic
    critic = make_critic(
        features_n,
        env_spec.action_n,
        cfg.algorithm.critic_outputs,
        stages_n=env_spec.stages_n if net.critic_sees_stages else 0,
        hidden_n=net.critic_hidden_n,
        layer_norm=net.critic_layer_norm,
        make_net=_dense_residual(net, net.spectral_norm != "none"),
        scale=OutputScale(net.output_scale, net.learn_output_scale) if is_scaled else None,
    )
    seen = [CRITIC_FEATURES, *([STAGES] if net.critic_sees_stages else []), ACTION]
    return ValueOperator(critic, in_keys=seen, out_keys=["state_action_value"])


def _dense_residual(net: NetworkCfg, spectral_norm: bool) -> MakeNet | None:
    """What replaces a head's MLP, if anything does."""
    if net.heads not in ("dense_residual", "advanced"):
        return None
    return partial(
        DenseResidualMLP, width=net.residual_width, blocks_n=net.residual_blocks_n, spectral_norm=spectral_norm
    )
