"""Behaviour cloning: pull the deterministic action towards the expert's."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional as F

MOTION_N = 4
"""Leading action components that are motions; the one after them is the gripper."""

MOTION_WEIGHT = 2.0
MOTION_HUBER_DELTA = 0.3
GRIPPER_WEIGHT = 0.3
GRIPPER_LOGIT_SCALE = 3.0
GRIPPER_TARGETS = (0.02, 0.98)
"""Close, open. Soft, so that the pre-tanh mean of the gripper stays finite."""


TARGET_SCALE_M = 0.1
"""Offsets of the expert's grasp are predicted in units of this."""

TARGET_N = 5
"""Predicted numbers: offset (3), cosine and sine of twice the turn."""


def localisation_loss(prediction: Tensor, target: Tensor, weight: Tensor) -> Tensor:
    """How well features tell where the expert's grasp is, averaged over the weighted samples that have one.

    An action label says little about place: most of its components are near zero or saturated. This says it outright.

    Args:
        prediction: ``(B, 5)``: offset from the tcp in units of ``TARGET_SCALE_M``, cosine and sine of twice the turn.
        target: ``(B, 6)``, as ``keys.EXPERT_TARGET``.
        weight: ``(B,)``; 0 leaves a sample out.

    Returns:
        Scalar; 0 if no sample has weight.
    """
    wanted = torch.cat([target[:, :3] / TARGET_SCALE_M, target[:, 3:5]], dim=1)
    per_sample = F.huber_loss(prediction, wanted, delta=0.5, reduction="none").mean(-1)
    counts = weight * target[:, 5]
    return (per_sample * counts).sum() / counts.sum().clamp(min=1.0)


def imitation_loss(mean: Tensor, expert_action: Tensor, weight: Tensor) -> Tensor:
    """Distance of the policy's deterministic action from the expert's, averaged over the weighted samples.

    Motions are regressed (Huber), the gripper is classified: an expert's command is open or closed, never between.

    Args:
        mean: ``(B, action_n)``, mean of the Gaussian before tanh.
        expert_action: ``(B, action_n)`` in [-1, 1].
        weight: ``(B,)``; 0 leaves a sample out.

    Returns:
        Scalar; 0 if no sample has weight.
    """
    motion = F.huber_loss(
        torch.tanh(mean[:, :MOTION_N]), expert_action[:, :MOTION_N], delta=MOTION_HUBER_DELTA, reduction="none"
    ).sum(-1)
    closed, opened = GRIPPER_TARGETS
    target = torch.where(expert_action[:, MOTION_N] > 0, opened, closed)
    gripper = F.binary_cross_entropy_with_logits(GRIPPER_LOGIT_SCALE * mean[:, MOTION_N], target, reduction="none")
    per_sample = MOTION_WEIGHT * motion + GRIPPER_WEIGHT * gripper
    return (per_sample * weight).sum() / weight.sum().clamp(min=1.0)
