"""Which grasps to look at first, given where the object is and how the arm stands."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from tr_grasp.errors import GraspError, unknown_name
from tr_grasp.grasps.grasp_set import GraspSet
from tr_grasp.grasps.motion_aware import MotionAwareScorer
from tr_grasp.grasps.reachability import ReachabilityField
from tr_grasp.motion import CollisionModel, Kinematics, inverse_kinematics

Array = NDArray[np.floating]
RankingName = Literal["none", "reachability", "motion", "nearness", "both", "ours"]

TOP_N = 5
"""Grasps that each half of ``both`` names, as in the thesis."""
GOOD_MANIPULABILITY = 0.06
"""Yoshikawa's measure of a UR5 in a comfortable posture; more is no better."""
RAD_PER_WORTH = 2.0
"""A way of so many radians weighs as much as the whole robustness of a grasp."""
GOOD_MARGIN_M = 0.1
"""Margin of a reachability field at which a pose is comfortable; more is no better."""
GOOD_CHANCE = 0.5
"""Grasps that are less likely to hold do not count as good in motion, as in the thesis."""


@dataclass(frozen=True, eq=False)
class RankingAids:
    """What else is known when grasps are ranked; each is used where it is given.

    Attributes:
        field: Its margin at the pre-grasp is what "reachable" is measured by, instead of manipulability.
        scorer: Says how likely each grasp holds while the object moves.
        velocity_base_mps: (3,) of the object against the hand, in the base frame, from a predictor; at rest by default.
        collisions: Only postures count in which the arm touches neither itself nor these obstacles, before the grasp
            and in it; so what may be touched, the object, is none of them.
    """

    field: ReachabilityField | None = None
    scorer: MotionAwareScorer | None = None
    velocity_base_mps: Array | None = None
    collisions: CollisionModel | None = None


NO_AIDS = RankingAids()


def rank_grasps(
    kinematics: Kinematics,
    grasps: GraspSet,
    T_base_obj: Array,
    q: Array,
    method: RankingName,
    back_off_m: float,
    aids: RankingAids = NO_AIDS,
) -> NDArray[np.integer]:
    """Indices (k,) of the grasps to try, best first.

    Args:
        kinematics: The arm.
        grasps: Of the object.
        T_base_obj: (4, 4) where the object is, or will be.
        q: (dof,) joints now.
        method: ``none``: all, in the order of the set. ``reachability``: those whose pre-grasp has a posture, those of
            the largest margin first (without a field, the most manipulable). ``motion``: those that more likely hold
            than not, the likeliest first. ``nearness``: those that have a posture, the nearest in joint space first.
            ``both``: the best five by reachability and the best five in motion (without a scorer, the nearest), as the
            thesis joins its two rankings. ``ours``: all reachable ones by robustness or chance in motion, nearness and
            margin or manipulability together.
        back_off_m: Distance of the pre-grasp from the grasp.
        aids: What else is known.

    Raises:
        GraspError: No such method; ``motion`` without a scorer; a scorer or field of another object or arm.
        MotionError: A pose that is not rigid, NaN, or another number of joints.
    """
    if method not in get_args(RankingName):
        raise GraspError(unknown_name("ranking", method, get_args(RankingName)))
    if method == "motion" and aids.scorer is None:
        raise GraspError("the ranking 'motion' needs a motion-aware scorer; give one, or choose another ranking.")
    if method == "none":
        return np.arange(len(grasps))
    T = T_base_obj @ grasps.grasps.poses()
    T_before = T.copy()
    T_before[:, :3, 3] -= back_off_m * T[:, :3, 2]
    reachable, postures = _reachable(kinematics, T_before, T, q, aids.collisions)
    if not len(reachable):
        return reachable
    ease = _ease(kinematics, postures, T_before[reachable], aids.field)
    way = np.linalg.norm(postures - q, axis=1)
    chance = _chance(grasps.subset(reachable), T_base_obj, aids)
    by_ease, by_way = reachable[np.argsort(-ease, kind="stable")], reachable[np.argsort(way, kind="stable")]
    if method == "reachability":
        return by_ease
    if method == "nearness":
        return by_way
    order = np.argsort(-chance, kind="stable")
    by_chance = reachable[order[chance[order] > GOOD_CHANCE]]
    if method == "motion":
        return by_chance
    if method == "both":
        other = by_way if aids.scorer is None else by_chance
        return np.array(list(dict.fromkeys([*by_ease[:TOP_N], *other[:TOP_N]])))
    comfort = np.minimum(ease, 1.0)
    worth = chance + 0.5 * comfort - way / RAD_PER_WORTH
    return reachable[np.argsort(-worth, kind="stable")]


def _reachable(
    kinematics: Kinematics, T_before: Array, T: Array, q: Array, collisions: CollisionModel | None
) -> tuple[NDArray[np.integer], Array]:
    """Indices (k,) of pre-grasps that have a posture, and those nearest to q (k, dof).

    With a collision model, the posture touches nothing, and so does the one of the grasp that is nearest to it.
    """
    postures = inverse_kinematics(kinematics, T_before, q).postures_rad
    there = np.asarray(np.isfinite(postures).all(-1))
    if collisions is not None and there.any():
        there[there] = collisions.free(postures[there])
    reachable = np.flatnonzero(there.any(1))
    # Postures are sorted by nearness, so the first is the nearest.
    nearest = postures[reachable, there[reachable].argmax(1)]
    if collisions is None or not len(reachable):
        return reachable, nearest
    final = inverse_kinematics(kinematics, T[reachable], nearest)
    good = final.found
    good[good] = collisions.free(final.q_rad[good]) if good.any() else False
    return reachable[good], nearest[good]


def _ease(kinematics: Kinematics, postures: Array, T_before: Array, field: ReachabilityField | None) -> Array:
    """(k,) how comfortably the arm stands; 1 is comfortable."""
    if field is None:
        return np.minimum(kinematics.manipulability(postures) / GOOD_MANIPULABILITY, 1.0)
    return field.require_for(kinematics.spec).values(T_before) / GOOD_MARGIN_M


def _chance(grasps: GraspSet, T_base_obj: Array, aids: RankingAids) -> Array:
    """(k,) how likely grasps hold: in motion if there is a scorer, else as they did on an object at rest."""
    if aids.scorer is None:
        return grasps.robustness
    velocity = np.zeros(3) if aids.velocity_base_mps is None else np.asarray(aids.velocity_base_mps, float)
    held = aids.scorer.require_for(grasps).score(grasps.grasps, T_base_obj[:3, :3].T @ velocity)
    return held
