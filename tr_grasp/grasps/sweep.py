"""The space that a hand passes through on its way to a grasp, and whether anything is in it.

Whatever a convex solid passes through on a straight line is convex again: the hull of where it starts and ends. So the
approach of the open hand is one hull for each of its solids, without steps that could jump over something thin. The
fingers' way is cut into short pieces, each taken as straight.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import coal
import numpy as np
import trimesh
from numpy.typing import NDArray

from tr_grasp.geometry import transform_points
from tr_grasp.grasps.grippers import hand_poses
from tr_grasp.grasps.poses import Grasps
from tr_grasp.objects import ObjectModel
from tr_grasp.robots import RobotSpec, Shape
from tr_grasp.robots.chain import origin_transform
from tr_grasp.robots.parts import Array

PIECES = 10
ROUND_SIDES = 16
PRESS_M = 0.01
"""Over the last of their way, pads that are not quite parallel to a side may touch it with an edge and turn it."""


class HandSweep:
    """Checks grasps of one gripper against one object and the table that it stands on.

    Args:
        gripper: A floating one.
        model: The object.
        approach_m: How far the open hand comes in a straight line.
        gap_m: Least distance of the hand from object and table; pads come nearer in the last piece of their way.
    """

    def __init__(self, gripper: RobotSpec, model: ObjectModel, approach_m: float, gap_m: float) -> None:
        self._table_m = float(model.bounds_m[0, 2]) + gap_m
        self._parts = [_solid(part.vertices) for part in model.parts]
        self._openings = [gripper.gripper.opening_at(share) for share in np.linspace(1.0, 0.0, PIECES + 1)]
        stages = [_corners(gripper, share) for share in np.linspace(1.0, 0.0, PIECES + 1)]
        still = {name for name in stages[0] if np.allclose(stages[0][name][0], stages[-1][name][0])}
        back = np.array([0.0, 0.0, -approach_m])
        self._approach = [np.concatenate([v, v + back]) for solids in stages[0].values() for v in solids]
        self._closing = [
            [
                np.concatenate(pair)
                for name in before
                if name not in still
                for pair in zip(before[name], after[name], strict=True)
            ]
            for before, after in pairwise(stages)
        ]
        self._approach_solids = [_solid(vertices) for vertices in self._approach]
        self._closing_solids = [[_solid(vertices) for vertices in piece] for piece in self._closing]
        self._request, self._result = coal.CollisionRequest(), coal.CollisionResult()
        self._request.security_margin = gap_m

    def free(self, grasps: Grasps) -> NDArray[np.bool_]:
        """(n,) whether the hand touches neither object nor table before the pads close on the object."""
        poses = grasps.poses()
        above = self._above_table(poses, grasps.width_m)
        return np.array(
            [ok and self._misses(T, width) for ok, T, width in zip(above, poses, grasps.width_m, strict=True)], bool
        )

    def _above_table(self, poses: Array, width_m: Array) -> NDArray[np.bool_]:
        down, height = poses[:, 2, :3], poses[:, 2, 3]
        above = (np.concatenate(self._approach) @ down.T + height).min(axis=0) > self._table_m
        for piece, narrow in zip(self._closing, self._openings[1:], strict=True):
            clear = (np.concatenate(piece) @ down.T + height).min(axis=0) > self._table_m
            above &= clear | (narrow < width_m)
        return above

    def _misses(self, T_obj_tcp: Array, width_m: float) -> bool:
        at = coal.Transform3s(T_obj_tcp[:3, :3], T_obj_tcp[:3, 3])
        if any(self._hits(solid, at) for solid in self._approach_solids):
            return False
        done = zip(self._closing_solids, self._openings[1:], strict=True)
        return not any(self._hits(solid, at) for piece, narrow in done if narrow > width_m + PRESS_M for solid in piece)

    def _hits(self, solid: coal.ConvexBase, at: coal.Transform3s) -> bool:
        still = coal.Transform3s.Identity()
        for part in self._parts:
            self._result.clear()
            if coal.collide(solid, at, part, still, self._request, self._result):
                return True
        return False


def _corners(gripper: RobotSpec, openness: float) -> dict[str, list[Array]]:
    """Corners (c, 3) of each solid of each link of the hand, in the tcp's frame."""
    poses = hand_poses(gripper, openness)
    return {
        link.name: [transform_points(poses[link.name], _shape_corners(shape)) for shape in link.shapes]
        for link in gripper.links
        if link.shapes
    }


def _shape_corners(shape: Shape) -> Array:
    """(c, 3) in the frame of its link; round solids as prisms around them."""
    if shape.kind == "mesh":
        mesh = trimesh.load_mesh(str(shape.mesh))
        corners = np.asarray(mesh.convex_hull.vertices) * shape.size_m
    elif shape.kind == "box":
        corners = np.array(np.meshgrid(*[[-edge / 2, edge / 2] for edge in shape.size_m])).reshape(3, -1).T
    elif shape.kind == "cylinder":
        radius, length = shape.size_m[0] / np.cos(np.pi / ROUND_SIDES), shape.size_m[1]
        turn = np.arange(ROUND_SIDES) * 2 * np.pi / ROUND_SIDES
        ring = radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
        corners = np.concatenate([np.column_stack([ring, np.full(ROUND_SIDES, z)]) for z in (-length / 2, length / 2)])
    else:
        corners = np.asarray(trimesh.creation.icosphere(1, 1.06 * shape.size_m[0]).vertices)
    return transform_points(origin_transform(shape.xyz_m, shape.rpy_rad), corners)


def _solid(corners: Sequence[Array] | Array) -> coal.ConvexBase:
    vertices = coal.StdVec_Vec3s()
    vertices.extend(np.asarray(corner, float) for corner in corners)
    return coal.Convex.convexHull(vertices, False, "Qt")
