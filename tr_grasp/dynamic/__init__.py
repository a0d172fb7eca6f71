"""Grasping what moves on its own."""

from tr_grasp.dynamic.charges import charged
from tr_grasp.dynamic.method import DynamicMethod, DynamicTask, GraspOutcome, MethodResult, Phase, TrialOver

__all__ = [
    "DynamicMethod",
    "DynamicTask",
    "GraspOutcome",
    "MethodResult",
    "Phase",
    "TrialOver",
    "charged",
]
