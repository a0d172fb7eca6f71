"""Simulated tasks: the only package in which a simulator runs."""

import gymnasium

from tr_grasp.envs.blind_pick_place import BlindPickPlaceEnv
from tr_grasp.envs.grasp_novel_objects import GraspNovelObjectsEnv
from tr_grasp.envs.make import env_spec, make_env
from tr_grasp.envs.outcome import Outcome
from tr_grasp.envs.torchrl_env import TorchRLGraspEnv

__all__ = ["BlindPickPlaceEnv", "GraspNovelObjectsEnv", "Outcome", "TorchRLGraspEnv", "env_spec", "make_env"]

gymnasium.register("DynamicGrasp-v1", entry_point="tr_grasp.envs.dynamic_grasp.gym_env:DynamicGraspEnv")
