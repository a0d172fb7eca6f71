"""Pairs of surface points that two pads can press without slipping, and the hands that would do it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tr_grasp.geometry import wxyz_from_matrix
from tr_grasp.grasps.grippers import pad_centre_z_m
from tr_grasp.grasps.poses import Grasps
from tr_grasp.objects import ObjectModel
from tr_grasp.objects.model import distance_outside
from tr_grasp.robots import RobotSpec

Array = NDArray[np.floating]
TOUCHING_M = 2e-4
"""Parts that are nearer to each other than this are one solid for a ray."""


@dataclass(frozen=True)
class ContactPairs:
    """Opposite points of an object's surface.

    Attributes:
        first, second: (n, 3) [m], in the object's frame.
    """

    first: Array
    second: Array

    @property
    def width_m(self) -> Array:
        """(n,) distance of the two."""
        return np.linalg.norm(self.second - self.first, axis=1)


def antipodal_pairs(model: ObjectModel, count: int, friction: float, rng: np.random.Generator) -> ContactPairs:
    """Points at both ends of lines through the object that lie in the friction cones of both.

    First points are uniform on the surface; lines that do not fit the cone of the second point are left out.

    Args:
        model: The object.
        count: How many first points are drawn; the pairs are fewer.
        friction: Half angle of the cones is its arc tangent.
        rng: Draws points and lines.
    """
    points, normals = surface_points(model, count, rng)
    directions = _in_cone(-normals, np.arctan(friction), rng)
    depth, exit_normals = _way_out(model, points - 1e-6 * normals, directions)
    cosine = np.einsum("ni,ni->n", directions, exit_normals)
    kept = (cosine >= np.cos(np.arctan(friction))) & (depth > 1e-3)
    return ContactPairs(points[kept], (points + depth[:, None] * directions)[kept])


def hands_on(pairs: ContactPairs, gripper: RobotSpec, rng: np.random.Generator) -> Grasps:
    """For each pair a hand whose pads meet it, at a random angle about the closing axis and a random depth."""
    n, spec = len(pairs.first), gripper.gripper
    y = (pairs.second - pairs.first) / pairs.width_m[:, None]
    across = np.cross(y, np.where(np.abs(y[:, :1]) < 0.9, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    angle = rng.uniform(0, 2 * np.pi, (n, 1))
    z = np.cos(angle) * across + np.sin(angle) * np.cross(y, across)
    R = np.stack([np.cross(y, z), y, z], axis=2)
    finger = spec.fingers[0]
    half_pad_m = abs(finger.tip_point_m[2] - finger.pad_point_m[2])
    table = np.linspace(0.0, 1.0, 33)
    pad_z = np.interp(
        [spec.openness(width) for width in pairs.width_m], table, [pad_centre_z_m(gripper, share) for share in table]
    )
    pad_z += rng.uniform(-0.5, 0.5, n) * half_pad_m
    position = (pairs.first + pairs.second) / 2 - pad_z[:, None] * z
    return Grasps(position, wxyz_from_matrix(R), pairs.width_m)


def surface_points(model: ObjectModel, count: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """About ``count`` points (n, 3), uniform on the surface of the parts' union, and their outward normals (n, 3)."""
    triangles = np.concatenate([part.triangles for part in model.parts])
    owner = np.repeat(np.arange(len(model.parts)), [len(part.faces) for part in model.parts])
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    area = np.linalg.norm(normals, axis=1)
    chosen = rng.choice(len(triangles), count, p=area / area.sum())
    u, v = rng.uniform(size=(2, count, 1))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    a, b, c = np.moveaxis(triangles[chosen], 1, 0)
    points, normals = a + u * (b - a) + v * (c - a), normals[chosen] / area[chosen][:, None]
    outside = points + 1e-5 * normals
    hidden = np.zeros(count, bool)
    for index, part in enumerate(model.parts):
        others = owner[chosen] != index
        hidden[others] |= distance_outside(part, outside[others]) < 0
    return points[~hidden], normals[~hidden]


def _in_cone(axes: Array, half_angle: float, rng: np.random.Generator) -> Array:
    """(n, 3) directions up to an angle off unit axes (n, 3), most of them near: flat pads hold best on flat sides."""
    n = len(axes)
    cosine = np.cos(half_angle * rng.uniform(size=(n, 1)) ** 2)
    turn = rng.uniform(0, 2 * np.pi, (n, 1))
    across = np.cross(axes, np.where(np.abs(axes[:, :1]) < 0.9, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    sideways = np.cos(turn) * across + np.sin(turn) * np.cross(axes, across)
    return cosine * axes + np.sqrt(1 - cosine**2) * sideways


def _way_out(model: ObjectModel, points: Array, directions: Array) -> tuple[Array, Array]:
    """How far (n,) rays from the surface run through the object, and the outward normals (n, 3) where they leave it."""
    spans = [_span(part, points, directions) for part in model.parts]
    depth, normals = np.zeros(len(points)), np.zeros_like(points)
    for _ in model.parts:  # a ray passes every convex part once at most
        for enter, leave, exit_normals in spans:
            longer = (enter <= depth + TOUCHING_M) & (leave > depth)
            depth = np.where(longer, leave, depth)
            normals = np.where(longer[:, None], exit_normals, normals)
    return depth, normals


def _span(part, points: Array, directions: Array) -> tuple[Array, Array, Array]:
    """Where rays enter and leave a convex part (n,), and the normals (n, 3) there; they leave first if they miss it."""
    corners = part.triangles
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    height = np.einsum("fi,fi->f", normals, corners[:, 0]) - points @ normals.T
    speed = directions @ normals.T
    with np.errstate(divide="ignore", invalid="ignore"):
        at = height / speed
    leave_at = np.where(speed > 1e-12, at, np.inf)
    enter = np.where(speed < -1e-12, at, -np.inf).max(axis=1)
    beside = ((np.abs(speed) <= 1e-12) & (height < 0)).any(axis=1)
    face = leave_at.argmin(axis=1)
    leave = np.where(beside, -np.inf, leave_at[np.arange(len(points)), face])
    return enter, np.where(enter > leave, -np.inf, leave), normals[face]
