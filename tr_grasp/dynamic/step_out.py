"""A way out of where the arm touches something, from which no plan can begin."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tr_grasp.motion import CollisionModel, MotionLimits

Array = NDArray[np.floating]

STEP_OUT_RAD, STEPS_OUT_N = 0.25, 100
"""MoveIt's remedy for a start that touches something: the nearest of so many random states around it that does not."""


def step_out(
    model: CollisionModel, limits: MotionLimits, q: Array, time_s: float, rng: np.random.Generator
) -> Array | None:
    """Joints (dof,) near others at which nothing is touched at a time; nothing if none of those tried is such."""
    steps = rng.uniform(-STEP_OUT_RAD, STEP_OUT_RAD, (STEPS_OUT_N, len(q)))
    around = np.clip(q + steps, limits.lower_rad, limits.upper_rad)
    around = around[model.free(around, np.full(STEPS_OUT_N, time_s))]
    return around[np.argmin(np.abs(around - q).sum(1))] if len(around) else None
