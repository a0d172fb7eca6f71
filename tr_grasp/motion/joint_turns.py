"""Full turns: the same posture at angles that differ by 2π, as far as joint limits allow."""

from __future__ import annotations

import numpy as np

from tr_grasp.motion.arguments import Array

TURN = 2 * np.pi


def nearest_turn(q: Array, reference: Array, lower: Array, upper: Array) -> Array:
    """Each angle plus the whole turns that bring it nearest to a reference, without leaving the limits.

    Args:
        q: (*batch, dof) angles; NaN stays NaN.
        reference: (dof,) or of the same shape.
        lower: (dof,) limits.
        upper: (dof,) limits.

    Returns:
        (*batch, dof); NaN where no number of turns brings an angle inside.
    """
    wanted = np.round((reference - q) / TURN)
    most = np.floor((upper - q) / TURN + 1e-9)
    least = np.ceil((lower - q) / TURN - 1e-9)
    turned = q + TURN * np.clip(wanted, least, most)
    return np.where(least <= most, turned, np.nan)


def distance(q: Array, reference: Array) -> Array:
    """(*batch,) largest difference of a joint to the reference; infinite where an angle is NaN."""
    return np.nan_to_num(np.abs(q - reference).max(-1), nan=np.inf)
