"""Where the hand should go next: what the arm reaches, where the camera sees the board, and what tells the most."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tr_grasp.calibration.board import BoardSpec
from tr_grasp.calibration.detection import pose_information
from tr_grasp.calibration.intrinsics import Intrinsics
from tr_grasp.calibration.problem import Problem, prior_noise
from tr_grasp.calibration.rigid import Array, transform_of
from tr_grasp.calibration.samples import Sample, Setup
from tr_grasp.errors import CalibrationError
from tr_grasp.geometry import invert_transform
from tr_grasp.motion import CollisionModel, IKCfg, Kinematics, inverse_kinematics

QUICK = IKCfg(rounds_n=3)
WEAK = 1e-3
"""Information that is assumed before the first sample, so that the first two can be compared at all."""


@dataclass(frozen=True)
class ViewCfg:
    """Which sights of the board are looked for."""

    distance_range_m: tuple[float, float] = (0.42, 0.80)
    """Between camera and the middle of the board."""

    tilt_deg: float = 40.0
    """Largest angle between the board and a board that faces the camera."""

    margin_px: float = 25.0
    """Least distance of the board from the edge of the picture."""

    candidates_n: int = 48
    """Sights to try; more are slower and find better ones."""


@dataclass(frozen=True, eq=False)
class View:
    """A pose to go to: ``T_base_tcp`` (4, 4), joints (dof,) that reach it, and where the board should be seen."""

    T_base_tcp: Array
    q_rad: Array
    T_cam_board: Array


def reachable_views(
    kinematics: Kinematics,
    setup: Setup,
    X: Array,
    Z: Array,
    board: BoardSpec,
    camera: Intrinsics,
    rng: np.random.Generator,
    cfg: ViewCfg | None = None,
) -> list[View]:
    """Random sights of the board that the arm reaches without touching itself.

    Args:
        kinematics: The arm.
        setup: Where the camera is.
        X: (4, 4) where the camera is, to a few centimetres: ``T_base_cam`` or ``T_tcp_cam``.
        Z: (4, 4) where the board is: ``T_tcp_board`` or ``T_base_board``.
        board: The board.
        camera: The camera.
        rng: For the sights.
        cfg: Which sights.
    """
    cfg = cfg or ViewCfg()
    sights = np.array(_sights(board, camera, rng, cfg)).reshape(-1, 4, 4)
    hand = Z @ invert_transform(sights) @ invert_transform(X)
    T_base_tcp = hand if setup == "eye_in_hand" else invert_transform(hand)
    # Far out of reach is not worth a search.
    near = np.linalg.norm(T_base_tcp[:, :3, 3], axis=1) < 1.2 * _reach_m(kinematics)
    sights, T_base_tcp = sights[near], T_base_tcp[near]
    if not len(sights):
        return []
    solutions = inverse_kinematics(kinematics, T_base_tcp, cfg=QUICK)
    reached = np.flatnonzero(solutions.found)
    if not len(reached):
        return []
    free = CollisionModel(kinematics).free(solutions.q_rad[reached])
    return [View(T_base_tcp[i], solutions.q_rad[i], sights[i]) for i in reached[free]]


def best_view(
    views: Sequence[View], samples: Sequence[Sample], setup: Setup, X: Array, Z: Array, board: BoardSpec,
    camera: Intrinsics,
) -> View:  # fmt: skip
    """The view that says most about where the camera is, beside the samples there are (D-optimal).

    Raises:
        CalibrationError: No views.
    """
    if not views:
        raise CalibrationError(
            "no pose was found that the arm reaches and where the camera sees the board; check the rough pose of the "
            "camera, how the board is held, and the range of distances."
        )
    points = np.concatenate(list(board.marker_corners_board.values()))
    candidates = [
        Sample(str(i), view.T_base_tcp, view.T_cam_board, pose_information(view.T_cam_board, points, camera))
        for i, view in enumerate(views)
    ]
    gained = _information(candidates, setup, X, Z)
    # A sample without corners is as good as one with them, for the question of where to go next.
    known = [Sample(s.name, s.T_base_tcp, s.T_cam_board, s.information) for s in samples]
    total = WEAK * np.eye(12) / len(candidates) * gained.trace(axis1=1, axis2=2).mean()
    if known:
        total = total + _information(known, setup, X, Z).sum(0)
    return views[int(np.argmax(np.linalg.slogdet(total + gained)[1]))]


def _information(samples: Sequence[Sample], setup: Setup, X: Array, Z: Array) -> Array:
    """(n, 12, 12) what each sample says about X and Z."""
    problem = Problem(samples, setup)
    A, C = problem.jacobian(X, Z), problem.covariances(X, Z, prior_noise(0.2))
    return np.swapaxes(A, 1, 2) @ np.linalg.inv(C) @ A


def _sights(board: BoardSpec, camera: Intrinsics, rng: np.random.Generator, cfg: ViewCfg) -> list[Array]:
    """``T_cam_board`` with the whole board in the picture."""
    found: list[Array] = []
    width, height = board.size_m
    middle = np.array([width / 2, height / 2, 0.0])
    for _ in range(20 * cfg.candidates_n):
        away = rng.uniform(*cfg.distance_range_m)
        at = rng.uniform([0, 0], [camera.width_px, camera.height_px])
        centre = away * np.array([(at[0] - camera.cx_px) / camera.fx_px, (at[1] - camera.cy_px) / camera.fy_px, 1.0])
        about, tilt = rng.uniform(0, 2 * np.pi), np.radians(cfg.tilt_deg) * np.sqrt(rng.uniform(0.05, 1.0))
        tilted = transform_of(np.r_[0, 0, 0, tilt * np.cos(about), tilt * np.sin(about), 0])
        T = tilted @ transform_of(np.r_[0, 0, 0, 0, 0, rng.uniform(-np.pi, np.pi)])
        T[:3, 3] = centre - T[:3, :3] @ middle
        outline = board.outline_board @ T[:3, :3].T + T[:3, 3]
        if (outline[:, 2] > 0.1).all() and camera.sees(camera.project(outline), cfg.margin_px):
            found.append(T)
        if len(found) == cfg.candidates_n:
            break
    return found


def _reach_m(kinematics: Kinematics) -> float:
    """Length of the arm stretched out."""
    joints = kinematics.joint_positions(kinematics.home_q_rad)
    return float(np.linalg.norm(np.diff(joints, axis=0), axis=1).sum())
