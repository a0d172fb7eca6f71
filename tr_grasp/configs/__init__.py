"""Settings: frozen dataclasses, one field for one flag."""

from tr_grasp.configs.agent import AlgorithmCfg, NetworkCfg
from tr_grasp.configs.env import ActionCfg, CameraCfg, EnvCfg, ObjectsCfg, ObservationCfg, RewardCfg, WorkspaceCfg
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
    "CameraCfg",
    "DemonstrationCfg",
    "EnvCfg",
    "ImitationCfg",
    "NetworkCfg",
    "ObjectsCfg",
    "ObservationCfg",
    "OptimiserCfg",
    "ReplayCfg",
    "RewardCfg",
    "TrainCfg",
    "TrainerCfg",
    "WorkspaceCfg",
]
