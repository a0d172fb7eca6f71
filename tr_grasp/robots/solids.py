"""Simple solids between points: what the links of our own robots are drawn and collided with."""

from __future__ import annotations

import numpy as np

from tr_grasp.robots.parts import Inertia, Shape, Vector


def rod(start: Vector, end: Vector, radius_m: float, colour: Vector, *, collides: bool = True) -> Shape:
    """A cylinder from point to point."""
    a, b = np.asarray(start, float), np.asarray(end, float)
    length = float(np.linalg.norm(b - a))
    x, y, z = (b - a) / length
    # URDF turns about x first: a pitch from z towards x, after a roll that takes z towards -y.
    roll, pitch = -np.arcsin(np.clip(y, -1.0, 1.0)), np.arctan2(x, z)
    return Shape(
        "cylinder", (radius_m, length), _vector((a + b) / 2), (float(roll), float(pitch), 0.0), colour, collides
    )


def tube(start: Vector, end: Vector, radii_m: tuple[float, float], colour: Vector, steps: int = 4) -> tuple[Shape, ...]:
    """A tapering rod: one cylinder that collides and thinner or thicker ones that are seen."""
    a, b = np.asarray(start, float), np.asarray(end, float)
    cuts = np.linspace(0.0, 1.0, steps + 1)
    radii = np.linspace(*radii_m, steps)
    seen = [
        rod(_vector(a + s * (b - a)), _vector(a + e * (b - a)), float(radius), colour, collides=False)
        for s, e, radius in zip(cuts[:-1], cuts[1:], radii, strict=True)
    ]
    return hidden(rod(start, end, float(np.mean(radii_m)), colour)), *seen


def capsule(start: Vector, end: Vector, radius_m: float, colour: Vector) -> tuple[Shape, ...]:
    """A rod with round ends; the ends are only seen."""
    return rod(start, end, radius_m, colour), ball(start, radius_m, colour), ball(end, radius_m, colour)


def ball(centre: Vector, radius_m: float, colour: Vector, *, collides: bool = False) -> Shape:
    """A sphere."""
    return Shape("sphere", (radius_m,), centre, colour=colour, collides=collides)


def block(
    size_m: Vector, centre: Vector, colour: Vector, rpy_rad: Vector = (0.0, 0.0, 0.0), *, collides: bool = True
) -> Shape:
    """A box."""
    return Shape("box", size_m, centre, rpy_rad, colour, collides)


def hidden(shape: Shape) -> Shape:
    """The shape, to bump into but not to be seen."""
    return Shape(shape.kind, shape.size_m, shape.xyz_m, shape.rpy_rad, shape.colour, shape.collides, drawn=False)


def rod_inertia(mass_kg: float, radius_m: float, length_m: float, axis: str = "z") -> Inertia:
    """(ixx, iyy, izz, ixy, ixz, iyz) of a solid cylinder along an axis."""
    across = mass_kg * (3 * radius_m**2 + length_m**2) / 12
    along = mass_kg * radius_m**2 / 2
    xx, yy, zz = (along if axis == name else across for name in "xyz")
    return xx, yy, zz, 0.0, 0.0, 0.0


def _vector(values: np.ndarray) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z
