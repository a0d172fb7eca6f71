"""Robotic grasping in SAPIEN/ManiSkill, learned with TorchRL."""

__version__ = "0.1.0"
