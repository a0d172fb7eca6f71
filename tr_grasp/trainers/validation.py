"""Judging a policy while it learns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import torch
from tensordict.nn import TensorDictModuleBase
from torchrl.envs import EnvBase
from torchrl.envs.utils import ExplorationType, set_exploration_type

from tr_grasp.configs import TrainCfg
from tr_grasp.keys import SUCCESS
from tr_grasp.trainers.collect import EnvMaker

Evaluate = Callable[[TensorDictModuleBase], dict[str, float]]

VALIDATION_SEED = 20_000_000
"""Seed of the validation episodes: the same ones in every evaluation and run, never those of training."""


class Validation:
    """Deterministic episodes on training objects, always the same ones, each in a fresh scene."""

    def __init__(self, cfg: TrainCfg, make_env: EnvMaker) -> None:
        observation = replace(cfg.env.observation, expert_labels=False)
        self._env_cfg = replace(cfg.env, observation=observation, fresh_scene_every_n=1)
        self._episodes_n = cfg.trainer.evaluate_episodes
        self._make_env = make_env

    def __call__(self, policy: TensorDictModuleBase) -> dict[str, float]:
        """``success`` (share), ``reward`` and ``steps`` (means). Leaves torch's global generator as it was."""
        env = self._make_env(self._env_cfg, VALIDATION_SEED)
        try:
            with (
                torch.random.fork_rng(devices=[]),
                torch.no_grad(),
                set_exploration_type(ExplorationType.DETERMINISTIC),
            ):
                episodes = [self._episode(env, policy) for _ in range(self._episodes_n)]
        finally:
            env.close()
        success, reward, steps = (sum(values) / len(episodes) for values in zip(*episodes, strict=True))
        return {"success": success, "reward": reward, "steps": steps}

    def _episode(self, env: EnvBase, policy: TensorDictModuleBase) -> tuple[float, float, float]:
        steps = env.rollout(self._env_cfg.episode_steps, policy)["next"]
        return float(steps[SUCCESS][-1]), float(steps["reward"].sum()), float(len(steps))
