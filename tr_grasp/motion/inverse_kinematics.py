"""Joint angles for tool poses: closed form where there is one, least squares elsewhere."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tr_grasp.motion.arguments import Array, Flags, joint_rows, joint_vector, transforms
from tr_grasp.motion.joint_turns import distance, nearest_turn
from tr_grasp.motion.kinematics import Kinematics
from tr_grasp.motion.least_squares import LeastSquaresIK, Tolerance
from tr_grasp.motion.outcome import Outcome
from tr_grasp.motion.ur5_closed_form import UR5ClosedForm

ATTEMPTS = (1, 2, 4, 8, 16, 32)
"""Starts from the library in each round; poses that are solved take no part in the next one."""


@dataclass(frozen=True)
class IKCfg:
    """Settings of :func:`inverse_kinematics`; those on starts do not matter to a closed form."""

    tolerance: Tolerance = field(default_factory=Tolerance)
    """How near the tool must come."""

    postures_n: int = 1
    """Postures to look for, by as many starts for each pose. A closed form gives all there are."""

    rounds_n: int = len(ATTEMPTS)
    """Rounds of starts, each twice as many as before; fewer give up sooner on poses that are hard or out of reach."""

    iterations_n: int = 30
    """Steps from each start."""


@dataclass(frozen=True, eq=False)
class IKSolutions:
    """What inverse kinematics found.

    Attributes:
        postures_rad: (*batch, k, dof), nearest to the reference first; NaN where there are fewer than k.
    """

    postures_rad: Array

    @property
    def q_rad(self) -> Array:
        """(*batch, dof) the posture nearest to the reference; NaN where there is none."""
        return self.postures_rad[..., 0, :]

    @property
    def found(self) -> Flags:
        """(*batch,) whether there is a posture."""
        return np.asarray(np.isfinite(self.q_rad).all(-1))

    @property
    def outcomes(self) -> NDArray[np.object_]:
        """(*batch,) array of :class:`Outcome`: ``OK`` or ``UNREACHABLE``."""
        return np.array([Outcome.UNREACHABLE, Outcome.OK], object)[self.found.astype(int)]

    def all_of(self, index: int | tuple[int, ...] = ()) -> Array:
        """(m, dof) the postures of one pose, m ≥ 0."""
        postures = self.postures_rad[index]
        return postures[np.isfinite(postures).all(-1)]


def inverse_kinematics(
    kinematics: Kinematics, T_base_tcp: ArrayLike, reference_q: ArrayLike | None = None, cfg: IKCfg | None = None
) -> IKSolutions:
    """Joint angles within the limits at which the tool has the poses asked for.

    Args:
        kinematics: The arm. A UR5 is solved in closed form with all its postures.
        T_base_tcp: (*batch, 4, 4) poses of the tool, for example of all grasps of an object.
        reference_q: (dof,), or (*batch, dof), joints that solutions should be near to (largest difference of a joint),
            and from which the search starts; home if not given. Angles are turned by 2π towards it.
        cfg: Settings.

    Raises:
        MotionError: Poses that are not rigid, NaN, or another number of joints.
    """
    cfg = cfg or IKCfg()
    T = transforms("T_base_tcp", T_base_tcp)
    batch, flat = T.shape[:-2], T.reshape(-1, 4, 4)
    reference = _reference(kinematics, reference_q, len(flat))
    closed_form, search = _solvers(kinematics)
    if closed_form is not None:
        postures = closed_form.branches(flat)
    else:
        postures = _search(search(), flat, reference, given=reference_q is not None, cfg=cfg)
    postures = nearest_turn(postures, reference[:, None], kinematics.lower_rad, kinematics.upper_rad)
    if closed_form is not None:
        _refuse_wrong(kinematics, flat, postures, cfg.tolerance)
    order = np.argsort(distance(postures, reference[:, None]), axis=1, kind="stable")
    postures = np.take_along_axis(postures, order[..., None], 1)
    postures[~np.isfinite(postures).all(-1)] = np.nan
    return IKSolutions(postures.reshape(*batch, *postures.shape[1:]))


def _reference(kinematics: Kinematics, reference_q: ArrayLike | None, n: int) -> Array:
    if reference_q is None:
        rows = kinematics.home_q_rad
    elif np.ndim(reference_q) == 1:
        rows = joint_vector("reference_q", reference_q, kinematics.dof)
    else:
        rows = joint_rows("reference_q", np.reshape(reference_q, (-1, np.shape(reference_q)[-1])), kinematics.dof)
    return np.broadcast_to(rows, (n, kinematics.dof))


@lru_cache(maxsize=16)
def _solvers(kinematics: Kinematics) -> tuple[UR5ClosedForm | None, Callable[[], LeastSquaresIK]]:
    """The closed form, or nothing, and a function that gives the search (its library is made once, on demand)."""
    return UR5ClosedForm.of(kinematics), lru_cache(maxsize=1)(lambda: LeastSquaresIK(kinematics))


def _search(search: LeastSquaresIK, T: Array, reference: Array, given: bool, cfg: IKCfg) -> Array:
    """(b, k, dof) postures; a pose that has one is done, except that the first round looks for ``cfg.postures_n``."""
    found: list[Array] = []
    if given:
        found.append(search.solve(T, reference, cfg.tolerance, cfg.iterations_n)[:, None])
    open_poses = np.arange(len(T))
    used = 0
    for attempts in ATTEMPTS[: cfg.rounds_n]:
        if found:
            open_poses = np.flatnonzero(_count(found) < (cfg.postures_n if not used else 1))
        if not len(open_poses):
            break
        n = max(attempts, cfg.postures_n)
        starts = search.starts(T[open_poses], n, skip=used)
        goals = np.repeat(T[open_poses], n, axis=0)
        solved = search.solve(goals, starts.reshape(len(goals), -1), cfg.tolerance, cfg.iterations_n)
        postures = np.full((len(T), n, starts.shape[-1]), np.nan)
        postures[open_poses] = solved.reshape(len(open_poses), n, -1)
        found.append(postures)
        used += n
    return np.concatenate(found, axis=1)


def _count(found: list[Array]) -> Array:
    return np.isfinite(np.concatenate(found, axis=1)).all(-1).sum(1)


def _refuse_wrong(kinematics: Kinematics, T: Array, postures: Array, tolerance: Tolerance) -> None:
    """Turn postures that miss their pose into NaN: close to singularities closed forms lose digits."""
    there = np.asarray(np.isfinite(postures).all(-1))
    if there.any():
        reached = kinematics.chain.pose(postures[there])
        wanted = np.broadcast_to(T[:, None], (*postures.shape[:2], 4, 4))[there]
        gaps = np.abs(reached - wanted)
        wrong = (gaps[:, :3, 3].max(1) > tolerance.position_m) | (gaps[:, :3, :3].max((1, 2)) > tolerance.rotation_rad)
        there[there] = ~wrong
    postures[~there] = np.nan
