"""The one way to make an environment."""

from __future__ import annotations

import gymnasium as gym

from tr_grasp.configs import EnvCfg
from tr_grasp.envs.sensor import octree_spec
from tr_grasp.envs.torchrl_env import TorchRLGraspEnv
from tr_grasp.modules import EnvSpec


def make_env(cfg: EnvCfg | None = None, seed: int | None = None, *, photographs: bool = False) -> TorchRLGraspEnv:
    """Task I as a TorchRL environment with batch size ``[]``.

    Args:
        cfg: The task; defaults to :class:`EnvCfg`'s.
        seed: Seed of its episodes (0 if not given).
        photographs: Load SAPIEN's renderer even if the task's camera does not need it, for ``task.photograph``.

    Raises:
        ConfigError: If the objects or the robot do not exist.
        MeshError: If an object of a folder cannot be simulated.
    """
    more = {"render_backend": "cpu"} if photographs else {}
    task = gym.make("GraspNovelObjects-v1", cfg=cfg or EnvCfg(), disable_env_checker=True, **more).unwrapped
    return TorchRLGraspEnv(task, seed)


def env_spec(cfg: EnvCfg) -> EnvSpec:
    """What a network needs to know of a task."""
    return EnvSpec(octree=octree_spec(cfg), stack_n=cfg.observation.stack_n, pictures=cfg.observation.image)
