"""The composite sparse reward of the thesis, as pure functions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tr_grasp.configs import RewardCfg

STAGES = ("reach", "touch", "grasp", "lift")
"""Stages in the order in which they are completed."""


def completed_stages(done: NDArray[np.bool_], now: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Stages completed after this step.

    A stage counts only when all earlier ones are complete; once complete it stays so. Several can be completed in one
    step.

    Args:
        done: (*batch, 4) complete before this step.
        now: (*batch, 4) conditions that hold in this step.
    """
    return np.logical_and.accumulate(done | now, axis=-1)


def reward_terms(
    done_before: NDArray[np.bool_], done_after: NDArray[np.bool_], ground_contact: bool, cfg: RewardCfg
) -> dict[str, float]:
    """What this step pays, by name; the reward is their sum.

    Stage k pays ``stage_base ** k`` in the step that completes it: 1, 7, 49 and 343, 400 in all.
    """
    newly = done_after & ~done_before
    terms = {name: float(newly[k]) * cfg.stage_base**k for k, name in enumerate(STAGES)}
    terms["ground_contact"] = cfg.ground_contact * float(ground_contact)
    terms["step"] = cfg.step
    return terms
