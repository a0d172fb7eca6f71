"""Which tool poses an arm reaches without touching itself or the floor, and where the border of these poses is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from tr_grasp.motion import CollisionModel, IKCfg, Kinematics, box, inverse_kinematics

Array = NDArray[np.floating]
Flags = NDArray[np.bool_]

M_PER_RAD = 0.3
"""A turn of one radian counts as far as a shift by this."""
FLOOR_SIZE_M = (6.0, 6.0, 0.1)
SEARCH = IKCfg(postures_n=8, rounds_n=3)
"""Where there is no closed form: up to 24 starts for a pose, of which several may end in different postures."""


@dataclass(frozen=True)
class Domain:
    """Where tools are looked for: a cylinder about the base axis, any orientation.

    Attributes:
        radius_m: Of the cylinder.
        low_m, high_m: Its ends.
    """

    radius_m: float
    low_m: float
    high_m: float

    @classmethod
    def of(cls, kinematics: Kinematics, below_m: float = 0.1, beyond_m: float = 0.05) -> Domain:
        """All that an arm on a floor can reach, and a little more."""
        rng = np.random.default_rng(0)
        lower, upper = np.maximum(kinematics.lower_rad, -np.pi), np.minimum(kinematics.upper_rad, np.pi)
        tips = kinematics.chain.pose(rng.uniform(lower, upper, (20_000, kinematics.dof)))[:, :3, 3]
        radius = float(np.linalg.norm(tips[:, :2], axis=1).max())
        return cls(round(radius + beyond_m, 3), -below_m, round(float(tips[:, 2].max()) + beyond_m, 3))

    def sample(self, n: int, rng: np.random.Generator) -> Array:
        """``T_base_tcp`` (n, 4, 4), uniform in the volume and over all rotations."""
        azimuth, radius = rng.uniform(-np.pi, np.pi, n), self.radius_m * np.sqrt(rng.random(n))
        T = np.zeros((n, 4, 4))
        T[:, :3, :3] = Rotation.from_quat(rng.normal(size=(n, 4))).as_matrix()
        T[:, 0, 3], T[:, 1, 3] = radius * np.cos(azimuth), radius * np.sin(azimuth)
        T[:, 2, 3], T[:, 3, 3] = rng.uniform(self.low_m, self.high_m, n), 1.0
        return T


class Labeller:
    """Says by inverse kinematics and collision checks whether poses are reachable.

    Args:
        kinematics: The arm.
        floor_m: Height of the floor in the base frame; the base may stand in it.
    """

    def __init__(self, kinematics: Kinematics, floor_m: float = -0.005) -> None:
        self._arm = kinematics
        T_floor = np.eye(4)
        T_floor[2, 3] = floor_m - FLOOR_SIZE_M[2] / 2
        self._collisions = CollisionModel(kinematics, [box("floor", FLOOR_SIZE_M, T_floor)])

    def __call__(self, T_base_tcp: Array) -> Flags:
        """(n,) whether any posture that reaches a pose (n, 4, 4) touches nothing."""
        if not len(T_base_tcp):
            return np.zeros(0, bool)
        postures = inverse_kinematics(self._arm, T_base_tcp, cfg=SEARCH).postures_rad
        there = np.asarray(np.isfinite(postures).all(-1))
        if there.any():
            there[there] = self._collisions.free(postures[there])
        return np.asarray(there.any(1))


def moved(T: Array, shift_m: Array, turn_rad: Array, share: Array | float = 1.0) -> Array:
    """Poses (n, 4, 4) after a part (n,) of a shift (n, 3) and of a turn (n, 3) about the tool's own origin."""
    share = np.broadcast_to(np.asarray(share, float), (len(T),))[:, None]
    out = T.copy()
    out[:, :3, 3] += share * shift_m
    out[:, :3, :3] = Rotation.from_rotvec(share * turn_rad).as_matrix() @ T[:, :3, :3]
    return out


def border_poses(
    T: Array,
    is_reachable: Flags,
    reach_m: float,
    halvings_n: int,
    label: Callable[[Array], Flags],
    rng: np.random.Generator,
) -> Array:
    """(m, 4, 4) poses on the border, m ≤ n: from poses (n, 4, 4) a random way that crosses it, halved again and again.

    Args:
        T: The poses.
        is_reachable: Their labels.
        reach_m: Typical length of the ways; turns are as long at ``M_PER_RAD``.
        halvings_n: The border is found to about ``reach_m / 2**halvings_n``.
        label: Labels poses.
        rng: Of the ways.
    """
    shift = rng.normal(0, reach_m / np.sqrt(3), (len(T), 3))
    turn = rng.normal(0, reach_m / np.sqrt(3) / M_PER_RAD, (len(T), 3))
    crosses = label(moved(T, shift, turn)) != is_reachable
    T, shift, turn, start = T[crosses], shift[crosses], turn[crosses], is_reachable[crosses]
    near, far = np.zeros(len(T)), np.ones(len(T))
    for _ in range(halvings_n):
        middle = (near + far) / 2
        same = label(moved(T, shift, turn, middle)) == start
        near, far = np.where(same, middle, near), np.where(same, far, middle)
    return moved(T, shift, turn, (near + far) / 2)


def border_distance(T: Array, border: Array, is_symmetric: bool, farthest_m: float) -> Array:
    """(n,) distance [m] of poses (n, 4, 4) to the nearest of the border (m, 4, 4), turns at ``M_PER_RAD``.

    To 5 %, and ``farthest_m`` for all that are farther away: exact answers take several times as long.
    """
    tree = KDTree(_coordinates(border, is_symmetric))
    near, _ = tree.query(_coordinates(T, is_symmetric), eps=0.05, distance_upper_bound=farthest_m)
    return np.minimum(near, farthest_m)


def _coordinates(T: Array, is_symmetric: bool) -> Array:
    """(n, 12) numbers whose distance is that of poses, small turns assumed; symmetric arms look along their x axis."""
    if is_symmetric:
        azimuth = np.arctan2(T[:, 1, 3], T[:, 0, 3])
        T = np.einsum("nij,njk->nik", Rotation.from_rotvec(-azimuth[:, None] * [0.0, 0.0, 1.0]).as_matrix(), T[:, :3])
    return np.hstack([T[:, :3, 3], T[:, :3, :3].reshape(len(T), 9) * (M_PER_RAD / np.sqrt(2))])
