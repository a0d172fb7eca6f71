"""Learning: collecting, remembering, improving, and never losing any of it."""

from tr_grasp.trainers.replay import ReplayBuffer
from tr_grasp.trainers.run_folder import RunFolder
from tr_grasp.trainers.trainer import Trainer, TrainingResult

__all__ = ["ReplayBuffer", "RunFolder", "Trainer", "TrainingResult"]
