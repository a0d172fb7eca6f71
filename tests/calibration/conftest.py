"""Samples whose truth is known, made of corners without a picture: milliseconds instead of a laboratory's seconds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from tr_grasp.calibration import D415_COLOUR, BoardSpec, LabCfg, Laboratory, Sample, Setup
from tr_grasp.calibration.detection import pose_information
from tr_grasp.calibration.laboratory import Shot
from tr_grasp.calibration.rigid import Array, transform_of
from tr_grasp.geometry import invert_transform

BOARD = BoardSpec()
CORNERS = np.concatenate(list(BOARD.marker_corners_board.values()))


@dataclass(frozen=True, eq=False)
class World:
    """Samples and the two transforms that they come from."""

    setup: Setup
    X: Array
    Z: Array
    samples: list[Sample]


def random_transform(rng: np.random.Generator, shift_m: float = 0.5, turn_rad: float = 1.0) -> Array:
    return transform_of(np.r_[rng.uniform(-shift_m, shift_m, 3), rng.uniform(-turn_rad, turn_rad, 3)])


def sight(rng: np.random.Generator) -> Array:
    """``T_cam_board`` of a board in the picture, tilted and turned."""
    middle = np.r_[rng.uniform(-0.08, 0.08, 2) - np.array(BOARD.size_m) / 2, rng.uniform(0.5, 0.7)]
    return transform_of(np.r_[middle, rng.uniform(-0.5, 0.5, 2), rng.uniform(-1.2, 1.2)])


def make_world(
    setup: Setup, samples_n: int, seed: int = 0, pixel_px: float = 0.0, robot: tuple[float, float] = (0.0, 0.0)
) -> World:
    """Samples with noise of corners [px] and of the robot's pose [m, rad]."""
    rng = np.random.default_rng(seed)
    X, Z = random_transform(rng), random_transform(rng, 0.1)
    samples = []
    for i in range(samples_n):
        T = sight(rng)
        hand = Z @ invert_transform(T) @ invert_transform(X)
        T_base_tcp = hand if setup == "eye_in_hand" else invert_transform(hand)
        T_base_tcp = T_base_tcp @ transform_of(rng.normal(size=6) * np.repeat(robot, 3))
        samples.append(seen_sample(str(i), T_base_tcp, T, rng.normal(0, 1, (len(CORNERS), 2)) * pixel_px))
    return World(setup, X, Z, samples)


def seen_sample(name: str, T_base_tcp: Array, T_cam_board: Array, gaps_px: Array) -> Sample:
    """A sample whose corners are off by ``gaps_px``, with the pose that fits them best (one Gauss-Newton step)."""
    information = pose_information(T_cam_board, CORNERS, D415_COLOUR)
    pixels = project(T_cam_board) + gaps_px
    J = np.stack(
        [(project(T_cam_board @ transform_of(1e-6 * unit)) - project(T_cam_board)) / 1e-6 for unit in np.eye(6)]
    )
    step = np.linalg.solve(information, np.einsum("kij,ij->k", J, gaps_px))
    T = T_cam_board @ transform_of(step)
    error = float(np.sqrt(((project(T) - pixels) ** 2).sum(1).mean()))
    return Sample(name, T_base_tcp, T, information, pixels, CORNERS, error)


def project(T_cam_board: Array) -> Array:
    return D415_COLOUR.project(CORNERS @ T_cam_board[:3, :3].T + T_cam_board[:3, 3])


@pytest.fixture(params=["eye_on_base", "eye_in_hand"])
def setup(request: pytest.FixtureRequest) -> Setup:
    return request.param


@pytest.fixture(scope="session")
def lab() -> Laboratory:
    """A laboratory with the camera beside the robot."""
    return Laboratory(LabCfg(seed=1))


@pytest.fixture(scope="session")
def shots(lab: Laboratory) -> list[Shot]:
    """Pictures of it, the first three enough for a calibration."""
    return lab.shoot_all(lab.choose_views(6, pool_n=1))
