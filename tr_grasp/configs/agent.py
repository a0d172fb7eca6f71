"""What an agent is made of, and how it learns from reward: networks and algorithm."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from tr_grasp.configs.checks import require


@dataclass(frozen=True)
class NetworkCfg:
    """Encoder and heads."""

    encoder: Literal[
        "localising_ocnn", "vanilla_ocnn", "residual_ocnn", "o_ahrnet", "point_net", "image_cnn", "state_mlp"
    ] = "localising_ocnn"
    """Octree encoder: the fast one that localises, or one of the thesis (Vanilla, Residual, O-AHRNet); or a baseline
    that sees the leaves as points, the camera's pictures instead of an octree, or nothing but the proprioception."""

    shared_stack: bool = True
    """One encoder for all stacked observations instead of a copy for each (thesis)."""

    node_set: Literal["occupied", "siblings"] = "occupied"
    """Convolve on non-empty octants only, or on all eight children of a non-empty parent (O-CNN)."""

    num_blocks: int = 2
    """Residual blocks at each depth of residual_ocnn (thesis: 2 and 4)."""

    norm: Literal["none", "batch", "group", "layer"] = "none"
    """Normalisation after the convolutions of the thesis' encoders and in point_net."""

    target_statistics: Literal["follow", "initial"] = "follow"
    """What the target encoder's batch normalisation normalises by: the running statistics of the online encoder, or
    mean 0 and variance 1 for ever (thesis: its library updated the parameters alone)."""

    features_n: int = 128
    """Features of a frame of localising_ocnn and the baselines (the thesis' encoders have 170)."""

    heads: Literal["vanilla", "dense_residual", "dueling", "advanced"] = "vanilla"
    """MLPs; dense-residual networks; MLPs, the critics dueling; dense-residual networks, the critics dueling (the
    thesis' advanced actor and critic)."""

    actor_hidden_n: tuple[int, ...] = (256, 256)
    """Hidden widths of the actor's MLP."""

    log_std_init: float = -3.0
    """Log standard deviation of the fresh actor; small, so that noise does not drown what was imitated (thesis: 0)."""

    critic_hidden_n: tuple[int, ...] = (256, 256)
    """Hidden widths of each critic's MLP."""

    critic_layer_norm: bool = True
    """Normalise the hidden layers of the critics' MLPs (dense-residual networks always do)."""

    critic_sees_stages: bool = True
    """The critics also read the four stage flags, which make the once-paid reward Markov."""

    residual_width: int = 256
    """Width of dense-residual networks."""

    residual_blocks_n: int = 2
    """Blocks of dense-residual networks."""

    spectral_norm: Literal["none", "critic", "actor_critic", "all"] = "none"
    """Divide weights by their largest singular value: those inside the residual blocks of the critics, of actor and
    critics, or of both and every kernel of the encoder. Never those of a head's first and last layer."""

    output_scale: float = 1.0
    """Factor on the critics' output."""

    learn_output_scale: bool = False
    """Learn that factor, one for each critic, starting from ``output_scale``."""

    def __post_init__(self) -> None:
        has_blocks = self.heads in ("dense_residual", "advanced")
        require(
            self.spectral_norm == "none" or has_blocks,
            f"network.spectral_norm {self.spectral_norm} normalises residual blocks, and heads {self.heads} have none; "
            "choose network.heads dense_residual or advanced, or network.spectral_norm none",
        )
        require(
            self.spectral_norm != "all" or self.encoder != "image_cnn",
            "network.spectral_norm all normalises linear layers and octree convolutions, and image_cnn has others; "
            "choose network.spectral_norm actor_critic, or an octree encoder",
        )
        require(self.num_blocks >= 1, f"network.num_blocks must be at least 1, got {self.num_blocks}")
        require(self.residual_width >= 1, f"network.residual_width must be at least 1, got {self.residual_width}")
        require(
            self.residual_blocks_n >= 1, f"network.residual_blocks_n must be at least 1, got {self.residual_blocks_n}"
        )
        require(self.output_scale > 0, f"network.output_scale must be positive, got {self.output_scale}")


@dataclass(frozen=True)
class AlgorithmCfg:
    """The reinforcement-learning algorithm."""

    name: Literal["tqc", "sac", "td3", "ddpg"] = "tqc"
    """Truncated Quantile Critics (arXiv:2005.04269), SAC (1812.05905), TD3 (1802.09477) or DDPG (1509.02971)."""

    critics_n: int | None = None
    """Number of critics (None: 2, and 1 for ddpg, which has no more)."""

    quantiles_n: int = 25
    """Quantiles of each critic (tqc; the critics of the others estimate the mean)."""

    drop_per_net: int | None = None
    """Largest target atoms dropped, per critic; they are dropped from the pooled set (tqc; None: 2)."""

    gamma: float = 0.95
    """Discount of a policy step."""

    tau: float = 0.01
    """Share of the online network that enters the target network at every update."""

    reward_scale: float = 0.0125
    """Factor on the reward in the learner (the environment always pays the thesis' 400)."""

    alpha_init: float = 0.002
    """Initial entropy temperature (tqc, sac)."""

    alpha_min: float = 0.0001
    """Floor of the entropy temperature (tqc, sac)."""

    target_entropy: float = -12.0
    """Entropy that the temperature aims at (tqc, sac; thesis: -5). Low, so that the critics judge what the policy does
    without noise: one that relies on its noise to close the gripper hovers when it acts deterministically."""

    encoder_grad: Literal["critic", "actor", "both"] = "critic"
    """Which loss trains the encoder; the thesis' code used the actor's."""

    critic_reduction: Literal["sum", "mean"] = "sum"
    """TorchRL sums the loss over critics; the authors of TQC and SB3 take the mean."""

    normalise_actor_loss: bool = True
    """Divide the actor's loss by the mean absolute value so that imitation keeps its weight."""

    actor_warmup_updates: int = 3_000
    """The actor's reinforcement term grows linearly over this many updates (0: at once)."""

    actor_every_n: int | None = None
    """Updates from one reinforcement of actor and target networks to the next (None: 2 for td3, else 1)."""

    action_noise: float = 0.1
    """Standard deviation of Gaussian noise on collected actions (thesis: 0.025)."""

    target_noise: float = 0.2
    """Standard deviation of the noise on the target policy's action, clipped at 0.5 (td3)."""

    def __post_init__(self) -> None:
        self._check_numbers()
        require(
            self.name == "tqc" or self.drop_per_net is None,
            f"algorithm.drop_per_net drops quantiles, and the critics of {self.name} have none; "
            "choose algorithm.drop_per_net None or algorithm.name tqc",
        )
        require(
            self.name != "ddpg" or self.critics_n in (None, 1),
            f"algorithm.critics_n is {self.critics_n} and ddpg has one critic; "
            "choose algorithm.critics_n 1, or algorithm.name td3, which is ddpg with more",
        )
        require(
            self.is_stochastic or self.action_noise > 0,
            f"algorithm.action_noise is {self.action_noise}, and the policy of {self.name} explores by it alone; "
            "choose a positive one, such as 0.1",
        )

    def _check_numbers(self) -> None:
        require(0 < self.gamma < 1, f"algorithm.gamma must be in (0, 1), got {self.gamma}")
        require(0 < self.tau <= 1, f"algorithm.tau must be in (0, 1], got {self.tau}")
        require(self.critic_count >= 1, f"algorithm.critics_n must be at least 1, got {self.critics_n}")
        require(self.actor_period >= 1, f"algorithm.actor_every_n must be at least 1, got {self.actor_every_n}")
        require(self.action_noise >= 0, f"algorithm.action_noise must not be negative, got {self.action_noise}")
        require(self.target_noise >= 0, f"algorithm.target_noise must not be negative, got {self.target_noise}")
        require(
            0 <= self.dropped_quantiles < self.quantiles_n or self.name != "tqc",
            f"algorithm.drop_per_net must be 0..{self.quantiles_n - 1}, got {self.dropped_quantiles}",
        )

    @property
    def is_stochastic(self) -> bool:
        """Whether the policy samples its actions."""
        return self.name in ("tqc", "sac")

    @property
    def critic_count(self) -> int:
        """``critics_n``, or the algorithm's own."""
        own = 1 if self.name == "ddpg" else 2
        return own if self.critics_n is None else self.critics_n

    @property
    def critic_outputs(self) -> int:
        """Numbers that a critic gives: quantiles, or the mean alone."""
        return self.quantiles_n if self.name == "tqc" else 1

    @property
    def dropped_quantiles(self) -> int:
        """``drop_per_net``, or the algorithm's own."""
        return 2 if self.drop_per_net is None else self.drop_per_net

    @property
    def actor_period(self) -> int:
        """``actor_every_n``, or the algorithm's own."""
        own = 2 if self.name == "td3" else 1
        return own if self.actor_every_n is None else self.actor_every_n
