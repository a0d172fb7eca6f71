"""Where an object can be held, and where and when the arm is to meet it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tr_grasp.grasps import GraspSet
from tr_grasp.motion import Trajectory

Array = NDArray[np.floating]
Index = NDArray[np.integer]

HALF_TURN = np.diag([-1.0, -1.0, 1.0, 1.0])
"""About the tool's z: the fingers change places."""


@dataclass(frozen=True, eq=False)
class Candidates:
    """Grasps with the fingers either way round, best first.

    Attributes:
        T_obj_tcp: (m, 4, 4).
        worth: (m,) in [0, 1].
        number: (m,) which grasp of the set each is.
        lever_m: (m,) distance of the line along which the fingers close from the object's centre of mass.
    """

    T_obj_tcp: Array
    worth: Array
    number: Index
    lever_m: Array

    @classmethod
    def of(cls, grasps: GraspSet, chosen: Index) -> Candidates:
        """Those of the set that an index chooses."""
        T, worth = grasps.grasps.poses()[chosen], grasps.robustness[chosen]
        turned = T @ HALF_TURN
        lever = np.linalg.norm(np.cross(T[:, :3, 1], T[:, :3, 3]), axis=1)
        return cls(np.concatenate([T, turned]), np.tile(worth, 2), np.tile(chosen, 2), np.tile(lever, 2))

    def __len__(self) -> int:
        return len(self.worth)


@dataclass(frozen=True, eq=False)
class Meeting:
    """A grasp, the time at which the arm is at its pre-grasp, and the way there.

    Attributes:
        candidate: Which.
        T_obj_tcp: (4, 4) of the grasp.
        number: Which grasp of the set.
        q: (dof,) posture at the pre-grasp.
        start_s, arrival_s: Times of the world's clock.
        way: Trajectory between them.
        cost_s: Arrival and everything else that counts, from the start.
    """

    candidate: int
    T_obj_tcp: Array
    number: int
    q: Array
    start_s: float
    arrival_s: float
    way: Trajectory
    cost_s: float


@dataclass(frozen=True)
class Found:
    """What a search found: how many poses of (time, grasp) are within reach, in time, free; the best meeting if any."""

    reachable_n: int
    in_time_n: int
    free_n: int
    best: Meeting | None = None
    blocked: tuple[tuple[int, Array, float], ...] = ()
    """Candidate, posture, time of those that are free themselves, but not the direct way to them."""
