"""Grasps of a two-finger hand in the frame of an object, and how far they are from each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tr_grasp.geometry import matrix_from_wxyz

Array = NDArray[np.floating]
Index = NDArray[np.integer] | NDArray[np.bool_]

TURN_M_PER_RAD = 0.06
"""A turn of one radian counts as far as a shift by this: about half the length of the objects."""

_HALF_TURN = np.diag([-1.0, -1.0, 1.0])
"""About the approach direction: it swaps the fingers of a hand that cannot tell."""


@dataclass(frozen=True, eq=False)
class Grasps:
    """Where the hand is while it closes: it stands still, and the fingers meet the object.

    Attributes:
        position_m: (n, 3) of the tcp link in the object's frame; z of the tcp points out of the hand, fingers close
            along its y.
        q_wxyz: (n, 4) of the tcp link in the object's frame.
        width_m: (n,) distance of the pads when they hold.
    """

    position_m: Array
    q_wxyz: Array
    width_m: Array

    def __len__(self) -> int:
        return len(self.width_m)

    def subset(self, chosen: Index) -> Grasps:
        """Those that an index (m,) or a mask (n,) chooses, in that order."""
        return Grasps(self.position_m[chosen], self.q_wxyz[chosen], self.width_m[chosen])

    def poses(self) -> Array:
        """``T_obj_tcp`` (n, 4, 4)."""
        T = np.zeros((len(self), 4, 4))
        T[:, :3, :3] = matrix_from_wxyz(self.q_wxyz)
        T[:, :3, 3] = self.position_m
        T[:, 3, 3] = 1.0
        return T

    def approach(self) -> Array:
        """(n, 3) unit direction in which the hand comes, in the object's frame."""
        return matrix_from_wxyz(self.q_wxyz)[:, :, 2]


def pose_distance(one: Array, many: Array) -> Array:
    """(n,) distance [m] of a pose (4, 4) to others (n, 4, 4), for a hand whose two fingers are alike.

    Shift, and turn at ``TURN_M_PER_RAD``, as the sides of a right triangle.
    """
    shift = np.linalg.norm(many[:, :3, 3] - one[:3, 3], axis=1)
    R = one[:3, :3]
    angles = [_angle(np.einsum("nij,ij->n", many[:, :3, :3], turned)) for turned in (R, R @ _HALF_TURN)]
    return np.hypot(shift, TURN_M_PER_RAD * np.minimum(*angles))


def farthest_points(poses: Array, worth: Array, count: int) -> NDArray[np.integer]:
    """(m,) a spread-out choice of poses (n, 4, 4): the worthiest first, then always the one of greatest gain.

    The gain is the distance to the nearest one chosen, times the worth (n,) in [0, 1]; so between equals this is
    farthest-point sampling (Gonzalez 1985, doi:10.1016/0304-3975(85)90224-5).
    """
    if not len(poses) or count <= 0:
        return np.zeros(0, int)
    chosen = [int(np.argmax(worth))]
    nearest = pose_distance(poses[chosen[0]], poses)
    while len(chosen) < min(count, len(poses)):
        gain = nearest * worth
        gain[chosen] = -1.0
        chosen.append(int(np.argmax(gain)))
        nearest = np.minimum(nearest, pose_distance(poses[chosen[-1]], poses))
    return np.array(chosen)


def _angle(trace: Array) -> Array:
    return np.arccos(np.clip((trace - 1) / 2, -1.0, 1.0))
