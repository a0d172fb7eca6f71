"""Arms and scenes for the benchmarks of motion."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from tr_grasp.motion import CollisionModel, Kinematics, Obstacle, box
from tr_grasp.robots.spec import robot_spec

Array = NDArray[np.floating]
ROBOTS = ("panda", "ur5_rg2", "ur5_robotiq_2f85", "j2s7s300")

TABLE = ((2.0, 2.0, 0.02), (0.0, 0.0, -0.03))
SCENES = {
    "boxes": (
        TABLE,
        ((0.1, 0.1, 0.5), (0.45, 0.25, 0.25)),
        ((0.1, 0.1, 0.5), (0.45, -0.25, 0.25)),
        ((0.15, 0.15, 0.3), (-0.4, 0.3, 0.15)),
    ),
    "walls": (
        TABLE,
        ((1.4, 0.04, 0.5), (0.3, 0.55, 0.25)),
        ((1.4, 0.04, 0.5), (0.3, -0.55, 0.25)),
        ((0.5, 0.5, 0.02), (0.55, 0.0, 0.65)),
    ),
    "hard": (
        TABLE,
        ((0.06, 0.06, 0.45), (0.45, 0.12, 0.22)),
        ((0.06, 0.06, 0.45), (0.45, -0.15, 0.22)),
        ((0.3, 0.3, 0.02), (0.55, 0.0, 0.62)),
    ),
}
"""Edges and centres [m] of boxes; ``hard`` has two posts under a slab between left and right."""


@cache
def kinematics(name: str) -> Kinematics:
    """An arm, made once."""
    return Kinematics(robot_spec(name))


def obstacles(scene: str) -> list[Obstacle]:
    """The boxes of a scene."""
    return [box(f"{scene} {i}", size, place(*centre)) for i, (size, centre) in enumerate(SCENES[scene])]


def place(x: float, y: float, z: float) -> Array:
    """``T_base_body`` of a body that is not turned."""
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


def tool_down(x: float, y: float, z: float) -> Array:
    """``T_base_tcp`` of a tool that points down."""
    return place(x, y, z) @ np.diag([1.0, -1.0, -1.0, 1.0])


def postures(arm: Kinematics, n: int, rng: np.random.Generator) -> Array:
    """Joints (n, dof), uniform within the limits; joints that turn further get one turn around the middle."""
    middle = (arm.lower_rad + arm.upper_rad) / 2
    half = np.minimum((arm.upper_rad - arm.lower_rad) / 2, np.pi)
    return middle + half * rng.uniform(-1.0, 1.0, (n, arm.dof))


def free_posture(model: CollisionModel, rng: np.random.Generator) -> Array:
    """One that touches nothing."""
    while True:
        q = postures(model.kinematics, 64, rng)
        free = model.free(q)
        if free.any():
            return q[free][0]
