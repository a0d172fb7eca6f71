"""Which grasps hold on an object that moves."""

from tr_grasp.grasps.motion_aware.learn import Judgement, MotionLearnCfg, judge, split, train_scorer
from tr_grasp.grasps.motion_aware.scorer import MotionAwareScorer, motion_aware_scorer, shipped_scorers
from tr_grasp.grasps.motion_aware.tries import MotionTries, MotionTriesCfg, collect_motion_tries

__all__ = [
    "Judgement",
    "MotionAwareScorer",
    "MotionLearnCfg",
    "MotionTries",
    "MotionTriesCfg",
    "collect_motion_tries",
    "judge",
    "motion_aware_scorer",
    "shipped_scorers",
    "split",
    "train_scorer",
]
