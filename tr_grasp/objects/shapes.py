"""Convex solids from arrays: every one is a stack of rings, joined by planar sides [m]."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import trimesh
from numpy.typing import ArrayLike, NDArray

Vector = tuple[float, float, float]
Solid = trimesh.Trimesh
Profile = Sequence[tuple[float, float]]

ORIGIN: Vector = (0.0, 0.0, 0.0)
ROUND_SIDES = 20
BALL_SIDES = 12
WALL_SIDES = 12


def loft(rings: Sequence[ArrayLike]) -> trimesh.Trimesh:
    """Join rings, from the lowest to the highest, to a closed solid with outward faces.

    Args:
        rings: ``(n, 3)`` points each, counter-clockwise seen from above; the first and last may be one point
            ``(1, 3)``. The solid is convex if the rings are and the quadrilaterals between them are planar.
    """
    arrays = [np.atleast_2d(np.asarray(ring, dtype=np.float64)) for ring in rings]
    starts = np.cumsum([0, *(len(ring) for ring in arrays)])
    indices = [np.arange(start, start + len(ring)) for start, ring in zip(starts[:-1], arrays, strict=True)]
    faces = [_fan(indices[0][::-1]), _fan(indices[-1])]
    faces += [_band(low, high) for low, high in pairwise(indices)]
    return trimesh.Trimesh(np.concatenate(arrays), np.concatenate(faces), process=False)


def prism(polygon: ArrayLike, z_low_m: float, z_high_m: float) -> trimesh.Trimesh:
    """Extrude a convex, counter-clockwise ``(n, 2)`` polygon upwards."""
    flat = np.asarray(polygon, dtype=np.float64)
    return loft([np.column_stack([flat, np.full(len(flat), z)]) for z in (z_low_m, z_high_m)])


def box(size_m: Vector, centre_m: Vector = ORIGIN) -> trimesh.Trimesh:
    """An axis-aligned box."""
    x, y, z = (edge / 2 for edge in size_m)
    solid = prism([(-x, -y), (x, -y), (x, y), (-x, y)], -z, z)
    return moved(solid, centre_m)


def revolved(profile: Profile, sides: int = ROUND_SIDES) -> trimesh.Trimesh:
    """Turn a convex profile of (radius, z) points, from bottom to top, about z; radius 0 makes a tip.

    Radii are those of the corners of the regular polygons that stand for circles.
    """
    return loft([_circle(radius, z, sides) for radius, z in profile])


def cylinder(radius_m: float, z_low_m: float, z_high_m: float, sides: int = ROUND_SIDES) -> trimesh.Trimesh:
    """An upright cylinder about z."""
    return revolved([(radius_m, z_low_m), (radius_m, z_high_m)], sides)


def capsule(radius_m: float, straight_m: float) -> trimesh.Trimesh:
    """An upright cylinder of length ``straight_m`` with round ends, centred; no length makes a sphere."""
    angles = np.linspace(0.0, np.pi / 2, 3)[:-1] if straight_m > 0 else np.radians([18.0, 54.0])
    top = [(radius_m * np.cos(a), straight_m / 2 + radius_m * np.sin(a)) for a in angles]
    top.append((0.0, straight_m / 2 + radius_m))
    return revolved([*((r, -z) for r, z in reversed(top)), *top], BALL_SIDES)


def sphere(radius_m: float) -> trimesh.Trimesh:
    """A centred sphere of 60 plane faces."""
    return capsule(radius_m, 0.0)


def wall(
    outer_low_m: float,
    outer_high_m: float,
    thickness_m: float,
    z_low_m: float,
    z_high_m: float,
    sides: int = WALL_SIDES,
) -> list[trimesh.Trimesh]:
    """The wall of a cup about z, as touching wedges; the first one faces +x.

    Args:
        outer_low_m: Outer radius at ``z_low_m``.
        outer_high_m: Outer radius at ``z_high_m``.
        thickness_m: Outer minus inner radius.
        z_low_m: Where the wall starts.
        z_high_m: Where the rim is.
        sides: Number of wedges.
    """
    edges = (np.arange(sides + 1) - 0.5) * 2 * np.pi / sides
    return [
        loft(
            [
                _sector(outer_low_m - thickness_m, outer_low_m, start, end, z_low_m),
                _sector(outer_high_m - thickness_m, outer_high_m, start, end, z_high_m),
            ]
        )
        for start, end in pairwise(edges)
    ]


def flat_radius(radius_m: float, sides: int = WALL_SIDES) -> float:
    """Distance from the axis to a side of a regular polygon with corners at ``radius_m``."""
    return float(radius_m * np.cos(np.pi / sides))


def moved(solid: trimesh.Trimesh, offset_m: Vector) -> trimesh.Trimesh:
    """A copy shifted by ``offset_m``."""
    return trimesh.Trimesh(solid.vertices + np.asarray(offset_m), solid.faces, process=False)


def lying(solid: trimesh.Trimesh) -> trimesh.Trimesh:
    """A copy turned so that its z axis points along +x."""
    return trimesh.Trimesh(solid.vertices[:, [2, 0, 1]], solid.faces, process=False)


def _circle(radius_m: float, z_m: float, sides: int) -> NDArray[np.float64]:
    if radius_m == 0:
        return np.array([[0.0, 0.0, z_m]])
    # Half a side on, so that a flat side and not a corner faces +x.
    angles = (np.arange(sides) + 0.5) * 2 * np.pi / sides
    return np.column_stack([radius_m * np.cos(angles), radius_m * np.sin(angles), np.full(sides, z_m)])


def _sector(inner_m: float, outer_m: float, start: float, end: float, z_m: float) -> NDArray[np.float64]:
    corners = [(inner_m, start), (outer_m, start), (outer_m, end), (inner_m, end)]
    return np.array([(radius * np.cos(angle), radius * np.sin(angle), z_m) for radius, angle in corners])


def _fan(ring: NDArray[np.int64]) -> NDArray[np.int64]:
    if len(ring) < 3:
        return np.empty((0, 3), dtype=np.int64)
    return np.column_stack([np.full(len(ring) - 2, ring[0]), ring[1:-1], ring[2:]])


def _band(low: NDArray[np.int64], high: NDArray[np.int64]) -> NDArray[np.int64]:
    low_next, high_next = np.roll(low, -1), np.roll(high, -1)
    if len(low) == 1:
        return np.column_stack([np.broadcast_to(low, high.shape), high_next, high])
    if len(high) == 1:
        return np.column_stack([low, low_next, np.broadcast_to(high, low.shape)])
    return np.concatenate([np.column_stack([low, low_next, high_next]), np.column_stack([low, high_next, high])])
