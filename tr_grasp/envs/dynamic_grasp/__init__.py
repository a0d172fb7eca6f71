"""The world of Task II: trials, their scene, who judges them, and a run from start to verdict."""

from tr_grasp.envs.dynamic_grasp.judge import Judge, Verdict
from tr_grasp.envs.dynamic_grasp.run import grasps_for, run_trial
from tr_grasp.envs.dynamic_grasp.scene import DynamicScene
from tr_grasp.envs.dynamic_grasp.trial import DYNAMIC_MOTIONS, Trial, make_trial

__all__ = [
    "DYNAMIC_MOTIONS",
    "DynamicScene",
    "Judge",
    "Trial",
    "Verdict",
    "grasps_for",
    "make_trial",
    "run_trial",
]
