"""Families of tools, bars and rings."""

from __future__ import annotations

import numpy as np

from tr_grasp.objects import shapes
from tr_grasp.objects.family import Groups, family


@family(radius_m=(0.006, 0.010), length_m=(0.08, 0.12), cap_length_m=(0.02, 0.035))
def pen(radius_m: float, length_m: float, cap_length_m: float) -> Groups:
    """A thin shaft with a tapered cap."""
    shaft = shapes.cylinder(radius_m, 0, length_m, shapes.BALL_SIDES)
    cap_end = length_m + cap_length_m
    cap = shapes.revolved([(radius_m, length_m), (0.6 * radius_m, cap_end)], shapes.BALL_SIDES)
    return [[shaft], [cap]]


@family(
    handle_length_m=(0.07, 0.12),
    handle_radius_m=(0.008, 0.013),
    head_length_m=(0.045, 0.075),
    head_width_m=(0.020, 0.032),
)
def hammer(handle_length_m: float, handle_radius_m: float, head_length_m: float, head_width_m: float) -> Groups:
    """A square head across the end of a round handle."""
    handle = shapes.cylinder(handle_radius_m, -handle_length_m, 0, shapes.BALL_SIDES)
    head = shapes.box((head_length_m, head_width_m, head_width_m), (0, 0, head_width_m / 2))
    return [[handle], [head]]


@family(
    blade_length_m=(0.03, 0.055),
    blade_width_m=(0.03, 0.055),
    blade_thickness_m=(0.006, 0.010),
    handle_length_m=(0.06, 0.10),
    handle_width_m=(0.012, 0.020),
)
def paddle(
    blade_length_m: float,
    blade_width_m: float,
    blade_thickness_m: float,
    handle_length_m: float,
    handle_width_m: float,
) -> Groups:
    """A thin blade at the end of a thicker handle."""
    blade = shapes.box((blade_length_m, blade_width_m, blade_thickness_m), (-blade_length_m / 2, 0, 0))
    handle = shapes.box((handle_length_m, handle_width_m, handle_width_m), (handle_length_m / 2, 0, 0))
    return [[blade], [handle]]


@family(bar_length_m=(0.06, 0.11), stem_length_m=(0.04, 0.08), width_m=(0.018, 0.030), thickness_m=(0.016, 0.028))
def tee(bar_length_m: float, stem_length_m: float, width_m: float, thickness_m: float) -> Groups:
    """A stem that meets the middle of a bar."""
    bar = shapes.box((bar_length_m, width_m, thickness_m), (0, width_m / 2, 0))
    stem = shapes.box((width_m, stem_length_m, thickness_m), (0, -stem_length_m / 2, 0))
    return [[bar], [stem]]


@family(
    long_m=(0.08, 0.13),
    short_m=(0.065, 0.10),
    width_m=(0.014, 0.024),
    thickness_m=(0.016, 0.026),
    angle_rad=(0.9, 1.57),
)
def cross(long_m: float, short_m: float, width_m: float, thickness_m: float, angle_rad: float) -> Groups:
    """Two bars that cross at an angle, in one plane."""
    half_width, half_thick = width_m / 2, thickness_m / 2
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    # Corners of the slanted bar: where its two edges leave the long bar, and its square end.
    right, left = ((half_width + side * half_width * cos) / sin for side in (1, -1))
    along_and_across = np.array(
        [(right, -half_width), (short_m / 2, -half_width), (short_m / 2, half_width), (left, half_width)]
    )
    arm = along_and_across @ np.array([(cos, sin), (-sin, cos)])
    long_bar = shapes.box((long_m, width_m, thickness_m))
    return [[long_bar], [shapes.prism(polygon, -half_thick, half_thick) for polygon in (arm, -arm)]]


@family(
    end_radius_m=(0.018, 0.031), end_length_m=(0.014, 0.030), grip_radius_m=(0.008, 0.014), grip_length_m=(0.035, 0.065)
)
def dumbbell(end_radius_m: float, end_length_m: float, grip_radius_m: float, grip_length_m: float) -> Groups:
    """A grip between two discs."""
    half = grip_length_m / 2
    grip = shapes.cylinder(grip_radius_m, -half, half, shapes.BALL_SIDES)
    ends = [
        shapes.cylinder(end_radius_m, *span) for span in ((-half - end_length_m, -half), (half, half + end_length_m))
    ]
    return [[grip], ends]


@family(radius_m=(0.034, 0.052), breadth_m=(0.010, 0.016), height_m=(0.016, 0.030))
def ring(radius_m: float, breadth_m: float, height_m: float) -> Groups:
    """A flat ring."""
    return [shapes.wall(radius_m, radius_m, breadth_m, 0, height_m)]


@family(
    held_out=True,
    handle_radius_m=(0.010, 0.017),
    handle_length_m=(0.05, 0.08),
    shaft_radius_m=(0.004, 0.007),
    shaft_length_m=(0.045, 0.08),
)
def tool(handle_radius_m: float, handle_length_m: float, shaft_radius_m: float, shaft_length_m: float) -> Groups:
    """A thick handle with a thin shaft, like a screwdriver."""
    waist_z = 0.85 * handle_length_m
    handle = shapes.revolved(
        [(handle_radius_m, 0), (handle_radius_m, waist_z), (0.6 * handle_radius_m, handle_length_m)], sides=8
    )
    shaft = shapes.cylinder(shaft_radius_m, handle_length_m, handle_length_m + shaft_length_m, shapes.BALL_SIDES)
    return [[handle], [shaft]]


@family(held_out=True, long_m=(0.055, 0.09), short_m=(0.03, 0.06), thickness_m=(0.015, 0.024), width_m=(0.025, 0.045))
def bracket(long_m: float, short_m: float, thickness_m: float, width_m: float) -> Groups:
    """Two arms at a right angle."""
    foot = shapes.box((long_m, width_m, thickness_m), (long_m / 2, 0, thickness_m / 2))
    upright = shapes.box((thickness_m, width_m, short_m), (thickness_m / 2, 0, thickness_m + short_m / 2))
    return [[foot], [upright]]


@family(
    held_out=True,
    length_m=(0.065, 0.10),
    width_m=(0.03, 0.055),
    height_m=(0.03, 0.05),
    notch_length_m=(0.018, 0.028),
    notch_depth_m=(0.010, 0.016),
)
def notched_brick(
    length_m: float, width_m: float, height_m: float, notch_length_m: float, notch_depth_m: float
) -> Groups:
    """A cuboid with a notch in its top."""
    base_m, side_m = height_m - notch_depth_m, (length_m - notch_length_m) / 2
    base = shapes.box((length_m, width_m, base_m), (0, 0, base_m / 2))
    side_x, side_z = (notch_length_m + side_m) / 2, base_m + notch_depth_m / 2
    sides = [shapes.box((side_m, width_m, notch_depth_m), (x, 0, side_z)) for x in (-side_x, side_x)]
    return [[base, *sides]]


@family(
    held_out=True,
    base_radius_m=(0.020, 0.031),
    base_height_m=(0.010, 0.018),
    stem_radius_m=(0.007, 0.011),
    stem_height_m=(0.03, 0.05),
    head_radius_m=(0.012, 0.018),
)
def pawn(
    base_radius_m: float, base_height_m: float, stem_radius_m: float, stem_height_m: float, head_radius_m: float
) -> Groups:
    """A disc, a stem and a ball, like a chess piece."""
    neck_z = base_height_m + stem_height_m
    base = shapes.cylinder(base_radius_m, 0, base_height_m)
    stem = shapes.cylinder(stem_radius_m, base_height_m, neck_z, shapes.BALL_SIDES)
    head = shapes.moved(shapes.sphere(head_radius_m), (0, 0, neck_z + head_radius_m))
    return [[base, stem], [head]]


ALL = (pen, hammer, paddle, tee, cross, dumbbell, ring, tool, bracket, notched_brick, pawn)
