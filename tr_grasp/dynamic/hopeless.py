"""When there is no point in going on, and why: long before the path ends."""

from __future__ import annotations

import numpy as np

from tr_grasp.dynamic.attempt import Run
from tr_grasp.dynamic.meeting import Found
from tr_grasp.dynamic.method import GraspOutcome
from tr_grasp.dynamic.target import Forecast

Ending = tuple[GraspOutcome, str]

REACH_M = 1.0
"""What is further from the base than this is out of reach of every posture of the arms here."""
FAR_AHEAD_S = 60.0
PATIENCE_S = 10.0
"""For how long a way is looked for while grasps are free, but every way to them is blocked."""


def hopeless(
    run: Run, found: Found, forecast: Forecast, now_s: float, since_s: float, horizon_s: float
) -> Ending | None:
    """Why nothing will be met, or nothing where waiting may help.

    Args:
        run: Of the method.
        found: What the last search found: no meeting.
        forecast: Of the object.
        now_s: The time.
        since_s: For how long no search has found one.
        horizon_s: How far ahead searches look.
    """
    if contact := run.scene.way.contact(run.arm.commanded(now_s).q, now_s):
        return GraspOutcome.NO_WAY, f"where the arm is, {contact}"
    end = run.task.path_end_s
    ahead = np.arange(now_s, now_s + FAR_AHEAD_S if end is None else min(end, now_s + FAR_AHEAD_S), 0.5)
    is_near = np.linalg.norm(forecast.states(ahead)[0], axis=1) < REACH_M
    if not is_near.any():
        return GraspOutcome.UNREACHABLE, f"it stays further than {REACH_M:g} m from the base"
    comes_later = bool(is_near[ahead > now_s + horizon_s].any())
    if comes_later and not found.free_n:
        return None  # what comes within reach after the horizon is waited for
    if found.free_n and since_s < PATIENCE_S:
        return None
    if not found.reachable_n:
        return GraspOutcome.UNREACHABLE, "no posture of the arm reaches it anywhere on its path"
    if not found.in_time_n:
        return GraspOutcome.UNREACHABLE, "it is out of reach again before the arm could be there"
    if not found.free_n:
        return GraspOutcome.NO_GRASP, "every grasp that can be reached in time touches something"
    return GraspOutcome.NO_WAY, "every way to a grasp is blocked"
