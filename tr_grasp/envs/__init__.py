"""Simulated tasks: the only package in which a simulator runs."""

from tr_grasp.envs.grasp_novel_objects import GraspNovelObjectsEnv
from tr_grasp.envs.make import env_spec, make_env
from tr_grasp.envs.outcome import Outcome
from tr_grasp.envs.torchrl_env import TorchRLGraspEnv

__all__ = ["GraspNovelObjectsEnv", "Outcome", "TorchRLGraspEnv", "env_spec", "make_env"]
