"""Families of vessels: hollow or lidded, standing on a round base."""

from __future__ import annotations

from tr_grasp.objects import shapes
from tr_grasp.objects.family import Groups, family


@family(
    body_radius_m=(0.018, 0.031),
    body_height_m=(0.06, 0.10),
    shoulder_height_m=(0.008, 0.020),
    neck_radius_m=(0.008, 0.014),
    neck_height_m=(0.012, 0.030),
)
def bottle(
    body_radius_m: float,
    body_height_m: float,
    shoulder_height_m: float,
    neck_radius_m: float,
    neck_height_m: float,
) -> Groups:
    """A body, a shoulder and a narrower neck."""
    neck_z = body_height_m + shoulder_height_m
    shoulder = [(body_radius_m, 0), (body_radius_m, body_height_m), (neck_radius_m, neck_z)]
    # Three rings of more sides would be a hull that PhysX thins out.
    body = shapes.revolved(shoulder, sides=16)
    return [[body], [shapes.cylinder(neck_radius_m, neck_z, neck_z + neck_height_m, shapes.BALL_SIDES)]]


@family(
    base_radius_m=(0.018, 0.030),
    rim_radius_m=(0.038, 0.056),
    height_m=(0.035, 0.055),
    wall_m=(0.003, 0.006),
)
def bowl(base_radius_m: float, rim_radius_m: float, height_m: float, wall_m: float) -> Groups:
    """A wide vessel with a slanted wall."""
    return [round_vessel(base_radius_m, rim_radius_m, height_m, wall_m)]


@family(
    radius_m=(0.025, 0.0325),
    height_m=(0.055, 0.09),
    wall_m=(0.003, 0.005),
    handle_reach_m=(0.018, 0.028),
    handle_height_m=(0.030, 0.045),
    handle_thickness_m=(0.006, 0.010),
)
def mug(
    radius_m: float,
    height_m: float,
    wall_m: float,
    handle_reach_m: float,
    handle_height_m: float,
    handle_thickness_m: float,
) -> Groups:
    """A vessel with an upright wall and a handle."""
    side, thick = shapes.flat_radius(radius_m), handle_thickness_m
    middle_z, bar_m = height_m / 2, handle_reach_m - thick
    arm_z = (handle_height_m - thick) / 2
    arms = [shapes.box((bar_m, thick, thick), (side + bar_m / 2, 0, middle_z + z)) for z in (-arm_z, arm_z)]
    grip = shapes.box((thick, thick, handle_height_m), (side + bar_m + thick / 2, 0, middle_z))
    return [round_vessel(radius_m, radius_m, height_m, wall_m), [*arms, grip]]


@family(
    radius_m=(0.045, 0.060),
    base_share=(0.66, 0.78),
    depth_m=(0.014, 0.022),
    thickness_m=(0.004, 0.006),
    foot_radius_m=(0.018, 0.030),
    foot_height_m=(0.008, 0.013),
)
def plate(
    radius_m: float,
    base_share: float,
    depth_m: float,
    thickness_m: float,
    foot_radius_m: float,
    foot_height_m: float,
) -> Groups:
    """A shallow dish with a raised rim, on a foot by which it can be taken upside down."""
    foot = shapes.cylinder(foot_radius_m, -foot_height_m, 0)
    return [round_vessel(base_share * radius_m, radius_m, depth_m, thickness_m), [foot]]


@family(
    held_out=True,
    base_radius_m=(0.020, 0.027),
    rim_radius_m=(0.028, 0.0325),
    height_m=(0.06, 0.10),
    wall_m=(0.003, 0.005),
)
def cup(base_radius_m: float, rim_radius_m: float, height_m: float, wall_m: float) -> Groups:
    """A tall vessel that widens to the rim."""
    return [round_vessel(base_radius_m, rim_radius_m, height_m, wall_m)]


@family(
    held_out=True,
    radius_m=(0.024, 0.032),
    height_m=(0.06, 0.11),
    rim_height_m=(0.004, 0.008),
    rim_inset_m=(0.003, 0.006),
)
def can(radius_m: float, height_m: float, rim_height_m: float, rim_inset_m: float) -> Groups:
    """A cylinder with a bevel at either end."""
    lid_radius, top_z = radius_m - rim_inset_m, height_m - rim_height_m
    body = shapes.cylinder(radius_m, rim_height_m, top_z)
    bottom = shapes.revolved([(lid_radius, 0), (radius_m, rim_height_m)])
    top = shapes.revolved([(radius_m, top_z), (lid_radius, height_m)])
    return [[body], [bottom, top]]


def round_vessel(base_radius_m: float, rim_radius_m: float, height_m: float, wall_m: float) -> list[shapes.Solid]:
    """A floor of the wall's thickness and a wall that stands on the floor's edge."""
    floor_share = wall_m / height_m
    floor_radius = base_radius_m + floor_share * (rim_radius_m - base_radius_m)
    floor = shapes.revolved([(base_radius_m, 0), (floor_radius, wall_m)], shapes.WALL_SIDES)
    return [floor, *shapes.wall(floor_radius, rim_radius_m, wall_m, wall_m, height_m)]


ALL = (bottle, bowl, mug, plate, cup, can)
