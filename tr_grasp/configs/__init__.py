"""Settings: frozen dataclasses, one field for one flag."""

from tr_grasp.configs.agent import AlgorithmCfg, NetworkCfg
from tr_grasp.configs.appearance import AppearanceCfg
from tr_grasp.configs.camera import CameraArcCfg, CameraCfg, StereoCfg
from tr_grasp.configs.env import ActionCfg, EnvCfg, ObjectsCfg, ObservationCfg, RewardCfg, WorkspaceCfg
from tr_grasp.configs.randomisation import RandomisationCfg
from tr_grasp.configs.train import (
    DemonstrationCfg,
    ImitationCfg,
    OptimiserCfg,
    ReplayCfg,
    TrainCfg,
    TrainerCfg,
)

__all__ = [
    "ActionCfg",
    "AlgorithmCfg",
    "AppearanceCfg",
    "CameraArcCfg",
    "CameraCfg",
    "DemonstrationCfg",
    "EnvCfg",
    "ImitationCfg",
    "NetworkCfg",
    "ObjectsCfg",
    "ObservationCfg",
    "OptimiserCfg",
    "RandomisationCfg",
    "ReplayCfg",
    "RewardCfg",
    "StereoCfg",
    "TrainCfg",
    "TrainerCfg",
    "WorkspaceCfg",
]
