"""Families of plain convex solids."""

from __future__ import annotations

from tr_grasp.objects import shapes
from tr_grasp.objects.family import Groups, family


@family(length_m=(0.06, 0.13), width_m=(0.03, 0.062), height_m=(0.02, 0.055))
def box(length_m: float, width_m: float, height_m: float) -> Groups:
    """A cuboid."""
    return [[shapes.box((length_m, width_m, height_m))]]


@family(length_m=(0.08, 0.13), width_m=(0.045, 0.066), thickness_m=(0.012, 0.022))
def slab(length_m: float, width_m: float, thickness_m: float) -> Groups:
    """A flat cuboid, like a book."""
    return [[shapes.box((length_m, width_m, thickness_m))]]


@family(radius_m=(0.014, 0.032), height_m=(0.05, 0.13))
def cylinder(radius_m: float, height_m: float) -> Groups:
    """A cylinder."""
    return [[shapes.cylinder(radius_m, 0, height_m)]]


@family(radius_m=(0.014, 0.030), straight_m=(0.03, 0.09))
def capsule(radius_m: float, straight_m: float) -> Groups:
    """A cylinder with round ends."""
    return [[shapes.capsule(radius_m, straight_m)]]


@family(radius_m=(0.020, 0.034))
def sphere(radius_m: float) -> Groups:
    """A ball."""
    return [[shapes.sphere(radius_m)]]


@family(radius_m=(0.016, 0.034), height_m=(0.04, 0.10))
def hexagon(radius_m: float, height_m: float) -> Groups:
    """A prism of six sides."""
    return [[shapes.cylinder(radius_m, 0, height_m, sides=6)]]


@family(base_radius_m=(0.022, 0.0325), top_radius_m=(0.008, 0.018), height_m=(0.04, 0.10))
def cone(base_radius_m: float, top_radius_m: float, height_m: float) -> Groups:
    """A cone without its tip."""
    return [[shapes.revolved([(base_radius_m, 0), (top_radius_m, height_m)])]]


@family(length_m=(0.06, 0.11), width_m=(0.03, 0.058), height_m=(0.03, 0.055))
def wedge(length_m: float, width_m: float, height_m: float) -> Groups:
    """A ramp."""
    return [[shapes.prism([(0, 0), (length_m, 0), (0, height_m)], 0, width_m)]]


ALL = (box, slab, cylinder, capsule, sphere, hexagon, cone, wedge)
