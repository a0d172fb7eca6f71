"""Everything that a run consists of, and that its checkpoint therefore holds."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tr_grasp.configs import TrainCfg
from tr_grasp.errors import CheckpointError
from tr_grasp.modules import EnvSpec, build_agent
from tr_grasp.trainers.batches import BatchSampler
from tr_grasp.trainers.checkpoint import random_state, seed_everything, set_random_state
from tr_grasp.trainers.learner import Learner
from tr_grasp.trainers.progress import RecentEpisodes
from tr_grasp.trainers.replay import OBSERVATIONS_FOR_ANY_LENGTH, ReplayBuffer


@dataclass
class Counters:
    """How far a run has come."""

    env_steps: int = 0
    """Environment steps collected, demonstrations not counted."""

    pretrained: int = 0
    """Imitation updates made before anything was collected."""

    owed_updates: float = 0.0
    """Updates that the steps collected so far call for and that were not made yet; below 1 between chunks."""

    segment: int = 0
    """Stretches of collecting that were begun; decides the seeds of the next one."""

    best: list[float] = field(default_factory=list)
    """Success and reward of the best evaluation; empty before the first."""


class Session:
    """Networks, memories and counters, with all random generators seeded.

    Args:
        cfg: The settings of the run.
        env_spec: The sizes of its environments.
        folder: Where the learner leaves a batch that breaks it.
    """

    def __init__(self, cfg: TrainCfg, env_spec: EnvSpec, folder: Path) -> None:
        seed_everything(cfg.seed)
        self.agent = build_agent(cfg, env_spec).to(cfg.trainer.device)
        self.learner = Learner(self.agent, cfg, folder)
        demonstrations_n = max(1, cfg.demonstrations.transitions_n)
        stack_n, observed = env_spec.stack_n, self.agent.encoder.in_keys
        self.demonstrations = ReplayBuffer(demonstrations_n, stack_n, OBSERVATIONS_FOR_ANY_LENGTH, observed)
        self.experience = ReplayBuffer(cfg.replay.capacity, stack_n, observed=observed)
        self.sampler = BatchSampler(cfg, env_spec.octree, self.demonstrations, self.experience)
        self.episodes = RecentEpisodes()
        self.counters = Counters()

    def state_dict(self) -> dict[str, Any]:
        """Plain containers of tensors, numbers and text."""
        return {
            "counters": dataclasses.asdict(self.counters),
            "learner": self.learner.state_dict(),
            "demonstrations": self.demonstrations.state_dict(),
            "experience": self.experience.state_dict(),
            "episodes": self.episodes.state_dict(),
            "sampler": self.sampler.generator.get_state(),
            "random": random_state(),
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Restore exactly what :meth:`state_dict` returned, the global random generators included.

        Raises:
            CheckpointError: It belongs to other settings.
        """
        try:
            self.learner.load_state_dict(state["learner"])
            self.counters = Counters(**state["counters"])
        except (RuntimeError, ValueError, KeyError, TypeError) as error:
            raise CheckpointError(f"the checkpoint does not fit the settings: {_first_problem(error)}.") from error
        self.demonstrations.load_state_dict(state["demonstrations"])
        self.experience.load_state_dict(state["experience"])
        self.episodes.load_state_dict(state["episodes"])
        self.sampler.generator.set_state(state["sampler"])
        set_random_state(state["random"])


def _first_problem(error: Exception) -> str:
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return (lines[1] if len(lines) > 1 else lines[0] if lines else type(error).__name__).rstrip(".")
