from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.calibration.conftest import make_world, random_transform
from tr_grasp.calibration import D415_COLOUR, BoardSpec, Laboratory, Sample, Setup, View, ViewCfg, coverage_of
from tr_grasp.calibration.rigid import distance_m, transform_of
from tr_grasp.calibration.views import best_view, reachable_views
from tr_grasp.errors import CalibrationError
from tr_grasp.geometry import transform_points
from tr_grasp.motion import CollisionModel

BOARD = BoardSpec()
FEW = ViewCfg(candidates_n=12)


@pytest.fixture(scope="module")
def views(lab: Laboratory) -> list[View]:
    return reachable_views(
        lab.kinematics, "eye_on_base", lab.X, lab.Z, BOARD, D415_COLOUR, np.random.default_rng(0), FEW
    )


def test_every_view_is_reached_by_its_joints_without_touching(lab: Laboratory, views: list[View]) -> None:
    assert len(views) >= 3
    limits = lab.kinematics
    for view in views:
        assert limits.pose(view.q_rad) == pytest.approx(view.T_base_tcp, abs=2e-3)
    assert CollisionModel(lab.kinematics).free(np.array([view.q_rad for view in views])).all()


def test_in_every_view_the_whole_board_is_seen_from_the_front_at_the_asked_distance(
    lab: Laboratory, views: list[View]
) -> None:
    middle = np.r_[np.array(BOARD.size_m) / 2, 0.0]
    for view in views:
        assert lab.T_cam_board(view.T_base_tcp) == pytest.approx(view.T_cam_board, abs=1e-6)
        pixels = D415_COLOUR.project(transform_points(view.T_cam_board, BOARD.outline_board))
        assert D415_COLOUR.sees(pixels, FEW.margin_px)
        assert np.degrees(np.arccos(view.T_cam_board[2, 2])) <= FEW.tilt_deg + 1e-6
        assert FEW.distance_range_m[0] <= transform_points(view.T_cam_board, middle)[2] <= FEW.distance_range_m[1]


def test_an_arm_that_is_elsewhere_reaches_nothing(lab: Laboratory) -> None:
    far = transform_of([5.0, 0, 0, 0, 0, 0]) @ lab.X
    rng = np.random.default_rng(0)
    none = reachable_views(lab.kinematics, "eye_on_base", far, lab.Z, BOARD, D415_COLOUR, rng, FEW)
    assert none == []
    with pytest.raises(CalibrationError, match="no pose was found that the arm reaches"):
        best_view(none, [], "eye_on_base", far, lab.Z, BOARD, D415_COLOUR)


def test_the_best_view_leaves_the_least_volume_of_doubt(setup: Setup) -> None:
    # The slow way: the covariance of a calibration with each view, from the problem itself.
    from tr_grasp.calibration.detection import pose_information
    from tr_grasp.calibration.problem import Problem, prior_noise

    world = make_world(setup, 9, 2)
    points = np.concatenate(list(BOARD.marker_corners_board.values()))
    samples = [replace(s, pixels=None, points_board=None) for s in world.samples[:4]]
    views = [View(s.T_base_tcp, np.zeros(7), s.T_cam_board) for s in world.samples[4:]]
    doubt = []
    for view in views:
        seen = pose_information(view.T_cam_board, points, D415_COLOUR)
        every = [*samples, Sample("new", view.T_base_tcp, view.T_cam_board, seen)]
        solution = Problem(every, setup).refine(world.X, world.Z, prior_noise(0.2))
        doubt.append(np.linalg.slogdet(solution.covariance)[1])
    chosen = best_view(views, samples, setup, world.X, world.Z, BOARD, D415_COLOUR)
    assert chosen is views[int(np.argmin(doubt))]


def test_a_second_view_like_the_first_is_not_chosen() -> None:
    world = make_world("eye_on_base", 3, 4)
    first, second, other = (View(s.T_base_tcp, np.zeros(7), s.T_cam_board) for s in world.samples)
    like = View(first.T_base_tcp @ transform_of([1e-4, 0, 0, 0, 0, 1e-3]), np.zeros(7), first.T_cam_board)
    chosen = best_view([like, other], world.samples[:2], "eye_on_base", world.X, world.Z, BOARD, D415_COLOUR)
    assert chosen is other
    assert second is not other


def test_coverage_worked_by_hand() -> None:
    turns = [(0, 0, 0), (np.pi / 4, 0, 0), (0, np.pi / 4, 0), (0, 0, np.pi / 4)]
    samples = [Sample(str(i), transform_of(np.r_[0.1 * i, 0, 0, turn]), np.eye(4)) for i, turn in enumerate(turns)]
    coverage = coverage_of(samples)
    assert coverage.samples_n == 4
    assert coverage.way_m == pytest.approx(0.3)
    # Two quarters of a right angle about axes that are orthogonal: cos(angle / 2) = cos²(π / 8).
    assert coverage.turn_deg == pytest.approx(np.degrees(2 * np.arccos(np.cos(np.pi / 8) ** 2)))
    assert coverage.missing == ["take 6 more; 10 to 15 samples are good."]
    assert coverage.degenerate is None


def test_what_is_missing_is_said_axis_by_axis() -> None:
    samples = [Sample(str(i), transform_of([0, 0, 0, 0.2 * i, 0.01 * i, 0]), np.eye(4)) for i in range(4)]
    about = coverage_of(samples)
    assert "parallel axes" in str(about.degenerate)
    assert any(sentence.startswith("turn the hand about its z axis") for sentence in about.missing)
    assert any("move the hand by 0.1 m" in sentence for sentence in about.missing)


def test_a_frame_fixed_to_the_hand_does_not_change_how_far_it_turned() -> None:
    world = make_world("eye_in_hand", 5, 7)
    T = random_transform(np.random.default_rng(1))
    moved = [replace(s, T_base_tcp=s.T_base_tcp @ T) for s in world.samples]
    assert coverage_of(moved).turn_deg == pytest.approx(coverage_of(world.samples).turn_deg)
    assert coverage_of(moved).spread_deg == pytest.approx(coverage_of(world.samples).spread_deg)
    assert distance_m(moved[0].T_base_tcp, world.samples[0].T_base_tcp) > 0
