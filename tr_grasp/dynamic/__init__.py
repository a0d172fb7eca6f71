"""Grasping what moves on its own."""

from tr_grasp.dynamic.charges import charged
from tr_grasp.dynamic.grasper import DynamicGrasper
from tr_grasp.dynamic.method import DynamicMethod, DynamicTask, GraspOutcome, MethodResult, Phase, TrialOver
from tr_grasp.dynamic.settings import GrasperCfg

__all__ = [
    "DynamicGrasper",
    "DynamicMethod",
    "DynamicTask",
    "GraspOutcome",
    "GrasperCfg",
    "MethodResult",
    "Phase",
    "TrialOver",
    "charged",
]
