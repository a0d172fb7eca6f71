"""The networks of a policy and its critics, put together from settings."""

from __future__ import annotations

from dataclasses import dataclass

from tensordict.nn import TensorDictModule, TensorDictSequential
from torch import Tensor, nn
from torchrl.envs.utils import ExplorationType
from torchrl.modules import ProbabilisticActor, TanhNormal, ValueOperator

from tr_grasp.configs import TrainCfg
from tr_grasp.keys import ACTION, ACTOR_FEATURES, CRITIC_FEATURES, OCTREE, PROPRIO, STAGES
from tr_grasp.modules.encoders import build_encoder
from tr_grasp.modules.heads import GaussianActor, QuantileCritic
from tr_grasp.modules.losses import EncodedTQCLoss
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


class Agent(nn.Module):
    """A policy and the critics that judge it, on one shared encoder.

    Attributes:
        encoder: TensorDict module, ``octree`` and ``proprio`` to ``actor_features``.
        actor: TensorDict module, ``actor_features`` to ``action``; deterministic (tanh of the mean) unless TorchRL's
            exploration type says otherwise.
        critics: TensorDict modules, ``critic_features``, maybe ``stages``, and ``action`` to quantiles.
        policy: Encoder, then actor.
        env_spec: The sizes of the environments that it fits.
    """

    def __init__(
        self, env_spec: EnvSpec, encoder: TensorDictModule, actor: ProbabilisticActor, critics: list[ValueOperator]
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


class Perception(nn.Module):
    """An encoder for any leading batch, the unbatched observation of one environment included."""

    def __init__(self, encoder: nn.Module) -> None:
        super().__init__()
        self.encoder = encoder

    def forward(self, frames: OctreeFrame, proprio: Tensor) -> Tensor:
        """Frames ``(*batch, stack)`` and proprioception ``(*batch, stack, n)`` to features ``(*batch, features_n)``."""
        *batch, stack_n, proprio_n = proprio.shape
        features = self.encoder(frames.reshape(-1, stack_n), proprio.reshape(-1, stack_n, proprio_n))
        return features.reshape(*batch, -1)


def build_agent(cfg: TrainCfg, env_spec: EnvSpec) -> Agent:
    """Networks with fresh weights from torch's global generator.

    Raises:
        ConfigError: An encoder that does not exist or does not fit the octrees.
    """
    net = cfg.network
    encoder = build_encoder(
        net.encoder,
        in_channels=env_spec.octree.channels,
        stack_n=env_spec.stack_n,
        shared_stack=net.shared_stack,
        node_set=net.node_set,
        spec=env_spec.octree,
        features_n=net.features_n,
    )
    features_n = encoder.features_n
    actor = GaussianActor(features_n, env_spec.action_n, net.actor_hidden_n, net.log_std_init)
    critics = [
        QuantileCritic(
            features_n,
            env_spec.action_n,
            cfg.algorithm.quantiles_n,
            stages_n=env_spec.stages_n if net.critic_sees_stages else 0,
            hidden_n=net.critic_hidden_n,
            layer_norm=net.critic_layer_norm,
        )
        for _ in range(cfg.algorithm.critics_n)
    ]
    seen = [CRITIC_FEATURES, *([STAGES] if net.critic_sees_stages else []), ACTION]
    return Agent(
        env_spec,
        TensorDictModule(Perception(encoder), in_keys=[OCTREE, PROPRIO], out_keys=[ACTOR_FEATURES]),
        ProbabilisticActor(
            TensorDictModule(actor, in_keys=[ACTOR_FEATURES], out_keys=["loc", "scale"]),
            in_keys=["loc", "scale"],
            out_keys=[ACTION],
            distribution_class=TanhNormal,
            default_interaction_type=ExplorationType.DETERMINISTIC,
        ),
        [ValueOperator(critic, in_keys=seen, out_keys=["state_action_value"]) for critic in critics],
    )


def build_loss(cfg: TrainCfg, agent: Agent) -> EncodedTQCLoss:
    """The reinforcement losses of an agent; encoder and actor stay the agent's own parameters."""
    algorithm = cfg.algorithm
    loss = EncodedTQCLoss(
        agent.encoder,
        agent.actor,
        list(agent.critics),
        encoder_grad=algorithm.encoder_grad,
        critic_reduction=algorithm.critic_reduction,
        normalise_actor_loss=algorithm.normalise_actor_loss,
        top_quantiles_to_drop_per_net=algorithm.drop_per_net,
        alpha_init=algorithm.alpha_init,
        min_alpha=algorithm.alpha_min,
        target_entropy=algorithm.target_entropy,
    )
    loss.make_value_estimator(gamma=algorithm.gamma)
    return loss
