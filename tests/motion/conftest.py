"""Arms, limits and scenes that the tests of motion share."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from tr_grasp.motion import CollisionModel, Kinematics, MotionLimits, box
from tr_grasp.robots.spec import robot_spec

ROBOTS = ("panda", "ur5_rg2", "ur5_robotiq_2f85", "j2s7s300")


@cache
def kinematics_of(name: str) -> Kinematics:
    return Kinematics(robot_spec(name))


@pytest.fixture(params=ROBOTS)
def arm(request: pytest.FixtureRequest) -> Kinematics:
    return kinematics_of(request.param)


@pytest.fixture
def ur5() -> Kinematics:
    return kinematics_of("ur5_rg2")


@pytest.fixture
def panda() -> Kinematics:
    return kinematics_of("panda")


@pytest.fixture
def limits() -> MotionLimits:
    """Three joints, each unlike the others."""
    return MotionLimits([-3.0, -2.0, -4.0], [3.0, 2.0, 4.0], [1.0, 2.0, 1.5], [4.0, 3.0, 5.0], [40.0, 30.0, 50.0])


def at(x: float, y: float, z: float) -> np.ndarray:
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


def tool_down(x: float, y: float, z: float) -> np.ndarray:
    T = np.diag([1.0, -1.0, -1.0, 1.0])
    T[:3, 3] = x, y, z
    return T


def postures(arm: Kinematics, n: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    middle = (arm.lower_rad + arm.upper_rad) / 2
    half = np.minimum((arm.upper_rad - arm.lower_rad) / 2, np.pi)
    return middle + half * rng.uniform(-1, 1, (n, arm.dof))


@pytest.fixture
def post_scene(ur5: Kinematics) -> CollisionModel:
    """A UR5 over a table with a post in front of it and a slab above."""
    return CollisionModel(
        ur5,
        [
            box("table", (2, 2, 0.02), at(0, 0, -0.03)),
            box("post", (0.06, 0.06, 0.45), at(0.57, 0.0, 0.22)),
            box("slab", (0.3, 0.3, 0.02), at(0.55, 0.0, 0.62)),
        ],
    )
