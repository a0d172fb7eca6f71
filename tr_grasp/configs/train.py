"""A training run: the agent, optimiser, replay, demonstrations, trainer."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from tr_grasp.configs.agent import AlgorithmCfg, NetworkCfg
from tr_grasp.configs.checks import require
from tr_grasp.configs.env import EnvCfg


@dataclass(frozen=True)
class OptimiserCfg:
    """Adam, for encoder, critics and actor together."""

    learning_rate: float = 7e-4
    """Initial learning rate."""

    decay_start: float = 0.5
    """Share of the run after which the rate falls linearly (0: from the beginning, thesis)."""

    final_fraction: float = 0.1
    """Rate at the end, as a share of the initial one (thesis: 0)."""

    gradient_clip: float = 10.0
    """Largest gradient norm (0: no clipping)."""

    averaging: float = 0.98
    """The policy that is judged and saved is a running mean of the weights, which keeps this share of itself at every
    update (0: the latest weights, thesis)."""

    def __post_init__(self) -> None:
        require(0 <= self.averaging < 1, f"optimiser.averaging must be in [0, 1), got {self.averaging}")


@dataclass(frozen=True)
class ReplayCfg:
    """Uniform replay; every observation is stored once."""

    capacity: int = 100_000
    """Transitions kept."""

    batch_size: int = 64
    """Transitions of one update."""

    symmetry_augmentation: bool = True
    """Turn and mirror each transition by a random element of the cube's symmetry about the vertical."""

    timeout: Literal["bootstrap", "terminal"] = "bootstrap"
    """An episode that ran out of time: value its last state like any other, or as the end of all reward (thesis)."""


@dataclass(frozen=True)
class DemonstrationCfg:
    """Transitions of the scripted expert, recorded before learning."""

    transitions_n: int = 7_000
    """How many (0: none, thesis)."""

    batch_share: float = 0.5
    """Share of every batch that is drawn from demonstrations."""

    noise_scale: tuple[float, ...] = (0.05, 0.15, 0.35)
    """Action noise; each episode draws one of these standard deviations."""

    gripper_flip_probability: float = 0.05
    """Chance of opening instead of closing, or the reverse, in a step."""

    wander_steps: int = 4
    """An episode begins with up to so many random motions, so that its states are not all near the grasp, from which
    nobody can learn to find it."""

    episode_steps: int = 20
    """Demonstration episodes are cut here."""

    file: str | None = None
    """Take the first ``transitions_n`` of a file that `tr-grasp demos record` wrote, instead of recording."""


@dataclass(frozen=True)
class ImitationCfg:
    """Behaviour-cloning term on expert labels, beside the reinforcement losses."""

    pretrain_updates: int = 2_000
    """Updates with the imitation loss alone, before anything is collected."""

    weight_initial: float = 2.0
    """Weight of the imitation loss when collection starts (0: no imitation)."""

    weight_final: float = 1.0
    """Weight after ``decay_env_steps``."""

    decay_env_steps: int = 10_000
    """Environment steps over which the weight changes linearly."""

    localisation_weight: float = 3.0
    """Weight of predicting, from the features, where the expert's grasp lies; it falls with the imitation weight."""

    states: Literal["demonstrations", "all"] = "demonstrations"
    """Imitate on demonstrations only, or also on the states that the policy visits (DAgger)."""

    reinforcement: bool = True
    """Keep the reinforcement losses; False leaves pure imitation (with ``states=all``: DAgger)."""


@dataclass(frozen=True)
class TrainerCfg:
    """The loop around it."""

    env_steps: int = 20_000
    """Environment steps to collect, demonstrations not counted."""

    episode_steps: int = 40
    """Collected episodes are cut here (truncated, not terminal), so that a stuck policy does not fill the memory."""

    deterministic_share: float = 0.5
    """Share of collected episodes that act without exploring: they meet the states where the policy gets stuck."""

    updates_per_step: float = 0.5
    """Gradient steps per environment step."""

    updates_per_episode: int = 0
    """Gradient steps per finished episode, whatever its length, beside those per step (thesis: 100)."""

    learning_starts: int = 200
    """Environment steps before the first update."""

    random_steps: int = 0
    """Environment steps with uniformly random actions at the beginning."""

    collector: Literal["process", "inline", "ray"] = "process"
    """Collect in processes beside the learner, in turn with it (exactly resumable), or in processes that Ray runs on
    this and other machines (extra ``ray``)."""

    workers_n: int = 1
    """Collecting processes."""

    envs_per_worker_n: int = 1
    """Environments of each process, which the policy serves in one batch."""

    steps_per_batch: int = 100
    """Environment steps that a collector hands over at once, of all its environments together."""

    threads_n: int = 1
    """Threads of the learner."""

    evaluate_every: int = 2_500
    """Environment steps between evaluations (0: never)."""

    evaluate_episodes: int = 100
    """Deterministic episodes of an evaluation, on validation seeds of the training objects."""

    checkpoint_every: int = 2_500
    """Environment steps between checkpoints."""

    device: str = "cpu"
    """Where the learner's networks live: ``cpu`` or ``cuda``."""

    def __post_init__(self) -> None:
        require(self.steps_per_batch >= 1, f"trainer.steps_per_batch must be at least 1, got {self.steps_per_batch}")
        require(self.episode_steps >= 1, f"trainer.episode_steps must be at least 1, got {self.episode_steps}")
        require(
            0 <= self.deterministic_share <= 1,
            f"trainer.deterministic_share must be 0..1, got {self.deterministic_share}",
        )
        require(self.workers_n >= 1, f"trainer.workers_n must be at least 1, got {self.workers_n}")
        require(
            self.envs_per_worker_n >= 1, f"trainer.envs_per_worker_n must be at least 1, got {self.envs_per_worker_n}"
        )
        require(
            self.steps_per_batch % self.envs_per_worker_n == 0,
            f"trainer.steps_per_batch must be a multiple of trainer.envs_per_worker_n, got {self.steps_per_batch} and "
            f"{self.envs_per_worker_n}",
        )
        require(
            self.updates_per_step >= 0, f"trainer.updates_per_step must not be negative, got {self.updates_per_step}"
        )
        require(
            self.updates_per_episode >= 0,
            f"trainer.updates_per_episode must not be negative, got {self.updates_per_episode}",
        )


@dataclass(frozen=True)
class TrainCfg:
    """Everything that decides a training run."""

    seed: int = 0
    """Seed of networks, environments and sampling."""

    env: EnvCfg = field(default_factory=EnvCfg)
    """The task."""

    network: NetworkCfg = field(default_factory=NetworkCfg)
    """Encoder and heads."""

    algorithm: AlgorithmCfg = field(default_factory=AlgorithmCfg)
    """The reinforcement-learning algorithm."""

    optimiser: OptimiserCfg = field(default_factory=OptimiserCfg)
    """Adam and its schedule."""

    replay: ReplayCfg = field(default_factory=ReplayCfg)
    """What is remembered."""

    demonstrations: DemonstrationCfg = field(default_factory=DemonstrationCfg)
    """What the expert shows."""

    imitation: ImitationCfg = field(default_factory=ImitationCfg)
    """How the expert is imitated."""

    trainer: TrainerCfg = field(default_factory=TrainerCfg)
    """The loop."""

    def __post_init__(self) -> None:
        if self.network.encoder == "image_cnn":
            self._check_pictures()

    def _check_pictures(self) -> None:
        reads = "network.encoder image_cnn reads pictures"
        require(
            self.env.observation.image,
            f"{reads}, and env.observation.image is off; choose env.observation.image True",
        )
        require(
            not self.replay.symmetry_augmentation,
            f"{reads}, and the camera does not turn with the scene that replay.symmetry_augmentation turns; "
            "choose replay.symmetry_augmentation False",
        )
        require(
            self.demonstrations.file is None,
            f"{reads}, and files of demonstrations hold octrees; choose demonstrations.file None, which records them",
        )
