"""Settings: frozen dataclasses, one field for one flag."""

from tr_grasp.configs.env import ActionCfg, CameraCfg, EnvCfg, ObjectsCfg, ObservationCfg, RewardCfg, WorkspaceCfg
from tr_grasp.configs.train import (
    DemonstrationCfg,
    ImitationCfg,
    NetworkCfg,
    OptimiserCfg,
    ReplayCfg,
    TqcCfg,
    TrainCfg,
    TrainerCfg,
)

__all__ = [
    "ActionCfg",
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
    "TqcCfg",
    "TrainCfg",
    "TrainerCfg",
    "WorkspaceCfg",
]
