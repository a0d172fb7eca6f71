"""Families wider than a gripper that opens 80 mm: it holds them by a corner, an edge that stands up, or a rim.

They are no part of the procedural set, whose test split others are compared on, but of the set ``procedural_wide``.
"""

from __future__ import annotations

from tr_grasp.objects import shapes
from tr_grasp.objects.family import Groups, family
from tr_grasp.objects.vessels import round_vessel


@family(length_m=(0.10, 0.14), width_m=(0.070, 0.096), thickness_m=(0.014, 0.026))
def book(length_m: float, width_m: float, thickness_m: float) -> Groups:
    """A flat cuboid that lies with its wide side up."""
    return [[shapes.box((length_m, width_m, thickness_m))]]


@family(length_m=(0.08, 0.12), width_m=(0.070, 0.096), height_m=(0.035, 0.065))
def carton(length_m: float, width_m: float, height_m: float) -> Groups:
    """A cuboid that a gripper spans in one direction at most."""
    return [[shapes.box((length_m, width_m, height_m))]]


@family(
    radius_m=(0.043, 0.060),
    base_share=(0.66, 0.86),
    height_m=(0.013, 0.026),
    wall_m=(0.003, 0.005),
)
def dish(radius_m: float, base_share: float, height_m: float, wall_m: float) -> Groups:
    """A shallow round vessel without a foot."""
    return [round_vessel(base_share * radius_m, radius_m, height_m, wall_m)]


@family(
    length_m=(0.085, 0.115),
    width_m=(0.080, 0.105),
    height_m=(0.013, 0.028),
    wall_m=(0.003, 0.006),
)
def tray(length_m: float, width_m: float, height_m: float, wall_m: float) -> Groups:
    """A shallow rectangular vessel with upright walls."""
    wall_height_m = height_m - wall_m
    z_m, inner_m = wall_m + wall_height_m / 2, width_m - 2 * wall_m
    ends = [shapes.box((wall_m, width_m, wall_height_m), (x * (length_m - wall_m) / 2, 0, z_m)) for x in (-1, 1)]
    sides = [
        shapes.box((length_m - 2 * wall_m, wall_m, wall_height_m), (0, y * (inner_m + wall_m) / 2, z_m))
        for y in (-1, 1)
    ]
    return [[shapes.box((length_m, width_m, wall_m), (0, 0, wall_m / 2))], [*ends, *sides]]


ALL = (book, carton, dish, tray)
