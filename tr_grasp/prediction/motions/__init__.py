"""How targets move: exact functions of time, in batches, with every random parameter of the benchmark."""

from tr_grasp.prediction.motions.bezier import bezier
from tr_grasp.prediction.motions.curves import circular, sinusoidal, two_tone
from tr_grasp.prediction.motions.lines import linear, linear_z, rotating, varying_speed
from tr_grasp.prediction.motions.sampling import MOTIONS, Motion, MotionCfg, sample_motion
from tr_grasp.prediction.motions.state import TargetState
from tr_grasp.prediction.motions.turns import random_turns

__all__ = [
    "MOTIONS",
    "Motion",
    "MotionCfg",
    "TargetState",
    "bezier",
    "circular",
    "linear",
    "linear_z",
    "random_turns",
    "rotating",
    "sample_motion",
    "sinusoidal",
    "two_tone",
    "varying_speed",
]
