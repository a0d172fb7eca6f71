from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

from tests.calibration.conftest import CORNERS, make_world, project, random_transform, sight
from tr_grasp.calibration import METHODS, Method, Sample, Setup, solve_closed_form, solve_hand_eye
from tr_grasp.calibration.dual_quaternions import solve_dual_quaternions
from tr_grasp.calibration.problem import Problem, prior_noise
from tr_grasp.calibration.rigid import adjoint, angle_rad, distance_m, small_motion, transform_of
from tr_grasp.errors import CalibrationError
from tr_grasp.geometry import invert_transform

seeds = st.integers(0, 10_000)


def turn(axis: int, angle: float, shift: tuple[float, float, float] = (0, 0, 0)) -> np.ndarray:
    vector = np.zeros(3)
    vector[axis] = angle
    return transform_of(np.r_[shift, vector])


@pytest.mark.parametrize("method", METHODS)
@given(seed=seeds)
@settings(max_examples=3)
def test_without_noise_every_solver_is_exact(method: Method, seed: int) -> None:
    for setup in ("eye_on_base", "eye_in_hand"):
        world = make_world(setup, 8, seed)
        X, Z = solve_closed_form(world.samples, setup, method)
        assert np.abs(X - world.X).max() < 1e-6
        assert np.abs(Z - world.Z).max() < 1e-6


@given(seed=seeds)
@settings(max_examples=2)
def test_another_base_frame_moves_the_camera_with_it(seed: int) -> None:
    world = make_world("eye_on_base", 5, seed, pixel_px=0.1)
    T_new_base = random_transform(np.random.default_rng(seed + 1))
    moved = [replace(s, T_base_tcp=T_new_base @ s.T_base_tcp) for s in world.samples]
    before, after = (
        solve_hand_eye(s, "eye_on_base", draws_n=20, reject_outliers=False) for s in (world.samples, moved)
    )
    assert np.abs(after.T_parent_cam - T_new_base @ before.T_parent_cam).max() < 1e-6
    assert np.abs(after.T_parent_board - before.T_parent_board).max() < 1e-6


@given(seed=seeds)
@settings(max_examples=2)
def test_another_hand_frame_moves_the_camera_in_the_hand(seed: int) -> None:
    world = make_world("eye_in_hand", 5, seed, pixel_px=0.1)
    T_tcp_flange = random_transform(np.random.default_rng(seed + 1), 0.05)
    moved = [replace(s, T_base_tcp=s.T_base_tcp @ T_tcp_flange) for s in world.samples]
    before, after = (
        solve_hand_eye(s, "eye_in_hand", draws_n=20, reject_outliers=False) for s in (world.samples, moved)
    )
    # The noise of a robot belongs to its tcp, so another one weighs a little differently.
    assert distance_m(T_tcp_flange @ after.T_parent_cam, before.T_parent_cam) < 2e-4


def test_three_quarter_turns_worked_by_hand() -> None:
    # The camera looks down from 1 m above the base; the board's origin is the hand's, so it is seen where the hand is:
    # x of the base to the right of the picture, y of the base up (away from the picture's y), height against its z.
    T_base_cam = np.array([[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 1], [0, 0, 0, 1]], float)
    hands = [
        np.eye(4),
        turn(0, np.pi / 2, (0.1, 0, 0)),
        turn(1, np.pi / 2, (0, 0.2, 0)),
        turn(2, np.pi / 2, (0, 0, 0.3)),
    ]
    seen = [
        np.array([[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 1], [0, 0, 0, 1]], float),
        np.array([[1, 0, 0, 0.1], [0, 0, 1, 0], [0, -1, 0, 1], [0, 0, 0, 1]], float),
        np.array([[0, 0, 1, 0], [0, -1, 0, -0.2], [1, 0, 0, 1], [0, 0, 0, 1]], float),
        np.array([[0, -1, 0, 0], [-1, 0, 0, 0], [0, 0, -1, 0.7], [0, 0, 0, 1]], float),
    ]
    samples = [Sample(str(i), hand, T) for i, (hand, T) in enumerate(zip(hands, seen, strict=True))]
    result = solve_hand_eye(samples, "eye_on_base")
    assert np.abs(result.T_parent_cam - T_base_cam).max() < 1e-9
    assert np.abs(result.T_parent_board - np.eye(4)).max() < 1e-9
    assert (result.name, result.board_name) == ("T_base_cam", "T_tcp_board")


def test_the_closed_form_is_opencvs(setup: Setup) -> None:
    world = make_world(setup, 9, 3, 0.3, (1e-3, 5e-3))
    hand = [s.T_base_tcp if setup == "eye_in_hand" else np.linalg.inv(s.T_base_tcp) for s in world.samples]
    R, t = cv2.calibrateHandEye(
        [T[:3, :3] for T in hand],
        [T[:3, 3] for T in hand],
        [s.T_cam_board[:3, :3] for s in world.samples],
        [s.T_cam_board[:3, 3] for s in world.samples],
        method=cv2.CALIB_HAND_EYE_DANIILIDIS,
    )
    result = solve_hand_eye(world.samples, setup, refine=False, reject_outliers=False)
    assert result.T_parent_cam[:3, :3] == pytest.approx(R, abs=1e-9)
    assert result.T_parent_cam[:3, 3] == pytest.approx(np.ravel(t), abs=1e-9)


def test_a_motion_of_half_a_turn_does_not_mislead_dual_quaternions() -> None:
    rng = np.random.default_rng(0)
    X, Z, sights = random_transform(rng), random_transform(rng, 0.1), [sight(rng) for _ in range(6)]
    apart = {"ours": [], "opencv": []}
    for _ in range(9):
        # The last sample is the first one turned about the optical axis.
        turned = sights[0].copy()
        turned[:3, :3] = transform_of(np.r_[0, 0, 0, 0, 0, np.pi])[:3, :3] @ turned[:3, :3]
        hand = np.array([Z @ invert_transform(T) @ invert_transform(X) for T in (*sights, turned)])
        hand = hand @ transform_of(rng.normal(size=(len(hand), 6)) * np.repeat((5e-4, 5e-3), 3))
        seen = np.array([*sights, turned])
        _, t = cv2.calibrateHandEye(
            hand[:, :3, :3], hand[:, :3, 3], seen[:, :3, :3], seen[:, :3, 3], method=cv2.CALIB_HAND_EYE_DANIILIDIS
        )
        apart["ours"].append(distance_m(solve_dual_quaternions(hand, seen), X))
        apart["opencv"].append(float(np.linalg.norm(np.ravel(t) - X[:3, 3])))
    assert max(apart["ours"]) < 0.02
    assert max(apart["opencv"]) > 0.1


def test_the_refinement_minimises_the_reprojection_error(setup: Setup) -> None:
    world = make_world(setup, 8, 5, pixel_px=0.2)
    noise = replace(prior_noise(0.2), position_m=1e-7, rotation_rad=1e-7)
    problem = Problem(world.samples, setup)
    found = problem.refine(*solve_closed_form(world.samples, setup), noise)

    def gaps(change: np.ndarray) -> np.ndarray:
        X, Z = world.X @ transform_of(change[:6]), world.Z @ transform_of(change[6:])
        return np.concatenate(
            [(project(T) - s.pixels).ravel() for T, s in zip(problem.expected(X, Z), world.samples, strict=True)]
        )

    slow = least_squares(gaps, np.zeros(12), x_scale=0.01, xtol=1e-12, ftol=1e-12).x
    assert distance_m(found.X, world.X @ transform_of(slow[:6])) < 5e-6
    assert angle_rad(found.X, world.X @ transform_of(slow[:6])) < 1e-5
    # It is a minimum of something else than the closed form's.
    assert distance_m(found.X, solve_closed_form(world.samples, setup)[0]) > 2e-5


def test_the_jacobian_is_the_slope_of_the_errors(setup: Setup) -> None:
    world = make_world(setup, 4, 6)
    problem = Problem(world.samples, setup)
    slope = np.stack(
        [
            problem.errors(world.X @ transform_of(d[:6]), world.Z @ transform_of(d[6:])) / 1e-6
            for d in 1e-6 * np.eye(12)
        ],
        axis=2,
    )
    assert problem.jacobian(world.X, world.Z) == pytest.approx(slope, abs=1e-4)


@given(seed=seeds)
@settings(max_examples=20)
def test_an_adjoint_carries_small_motions_through(seed: int) -> None:
    rng = np.random.default_rng(seed)
    T, motion = random_transform(rng), 1e-6 * rng.normal(size=6)
    assert small_motion(T @ transform_of(motion) @ invert_transform(T)) == pytest.approx(adjoint(T) @ motion, abs=1e-11)


def test_a_wrong_sample_is_named_and_left_out(setup: Setup) -> None:
    world = make_world(setup, 8, 7, 0.1, (2e-4, 5e-4))
    slipped = world.samples[3].T_base_tcp @ transform_of([0.02, -0.01, 0.02, 0.05, 0.05, 0])
    samples = [replace(s, T_base_tcp=slipped) if s.name == "3" else s for s in world.samples]
    result = solve_hand_eye(samples, setup)
    assert result.outliers == ["3"]
    assert "sample 3 contradicts" in result.warnings[0]
    assert distance_m(result.T_parent_cam, world.X) < 1e-3
    kept = solve_hand_eye(samples, setup, reject_outliers=False)
    assert distance_m(kept.T_parent_cam, world.X) > 3 * distance_m(result.T_parent_cam, world.X)


def test_good_samples_are_all_kept(setup: Setup) -> None:
    for seed in range(2):
        assert solve_hand_eye(make_world(setup, 6, seed, 0.1, (1e-3, 5e-3)).samples, setup, draws_n=20).outliers == []


def test_the_radius_covers_the_truth_about_as_often_as_it_says(setup: Setup) -> None:
    covered, small = [], []
    for seed in range(12):
        world = make_world(setup, 6, seed, 0.2, (1e-3, 4e-3))
        result = solve_hand_eye(world.samples, setup, reject_outliers=False, draws_n=200)
        covered.append(result.uncertainty.covers(result.T_parent_cam, world.X))
        small.append(distance_m(result.T_parent_cam, world.X) <= result.uncertainty.translation_m / 3)
    assert np.all(np.mean(covered, axis=0) >= 0.8)
    # And it is no larger than it needs to be: a third of it would not do.
    assert np.mean(small) < 0.95


def test_the_noise_of_the_robot_is_found() -> None:
    world = make_world("eye_on_base", 24, 11, 0.1, (1e-3, 4e-3))
    noise = solve_hand_eye(world.samples, "eye_on_base", reject_outliers=False, draws_n=20).noise
    assert noise.pixel_px == pytest.approx(0.1, rel=0.2)
    assert noise.position_m == pytest.approx(1e-3, rel=0.3)
    assert noise.rotation_rad == pytest.approx(4e-3, rel=0.3)


def test_a_board_of_another_size_is_refused(setup: Setup) -> None:
    world = make_world(setup, 10, 12, 0.1)
    larger = []
    for s in world.samples:
        T = s.T_cam_board.copy()
        T[:3, 3] /= 1.05  # markers are 5 % larger than was said, so the board seems nearer
        larger.append(replace(s, T_cam_board=T))
    with pytest.raises(CalibrationError, match=r"the board is 1\.0[45]\d .* times as large"):
        solve_hand_eye(larger, setup)


def test_a_board_half_a_percent_larger_is_told(setup: Setup) -> None:
    world = make_world(setup, 10, 12, 0.1)
    larger = []
    for s in world.samples:
        T = s.T_cam_board.copy()
        T[:3, 3] /= 1.008
        larger.append(replace(s, T_cam_board=T))
    warnings = solve_hand_eye(larger, setup, reject_outliers=False).warnings
    assert any("the board is 1.00" in sentence and "measure a marker again" in sentence for sentence in warnings)


def test_samples_that_cannot_be_of_one_camera_are_refused() -> None:
    world = make_world("eye_in_hand", 8, 1)
    with pytest.raises(CalibrationError, match=r"no place of the camera fits: .* check the setup"):
        solve_hand_eye(world.samples, "eye_on_base", reject_outliers=False)


def test_a_closed_form_that_failed_is_refused() -> None:
    # These samples are noisy; a solver that forgets what rotations are makes decimetres of that.
    world = make_world("eye_in_hand", 8, 2, 0.3, (2e-3, 2e-2))
    result = solve_hand_eye(world.samples, "eye_in_hand", "li", reject_outliers=False)
    assert distance_m(result.T_parent_cam, world.X) < 0.03
    with pytest.raises(CalibrationError, match=r"'li' alone leaves samples \d+ mm off on average"):
        solve_hand_eye(world.samples, "eye_in_hand", "li", refine=False, reject_outliers=False)


def test_a_sample_that_is_held_out_is_further_off_than_one_that_is_not(setup: Setup) -> None:
    result = solve_hand_eye(make_world(setup, 6, 13, 0.2, (1e-3, 4e-3)).samples, setup)
    assert result.held_out_m is not None
    assert result.held_out_m > np.mean([s.translation_m for s in result.samples])


def test_samples_of_poses_alone_are_solved_too(setup: Setup) -> None:
    world = make_world(setup, 10, 14, 0.1, (5e-4, 2e-3))
    bare = [Sample(s.name, s.T_base_tcp, s.T_cam_board) for s in world.samples]
    assert distance_m(solve_hand_eye(bare, setup).T_parent_cam, world.X) < 5e-3
    with pytest.raises(CalibrationError, match="cannot be mixed"):
        solve_hand_eye([bare[0], *world.samples[1:]], setup)


def test_too_few_samples_are_refused(setup: Setup) -> None:
    with pytest.raises(CalibrationError, match="too few samples: 3 are the least"):
        solve_hand_eye(make_world(setup, 2).samples, setup)


def test_parallel_axes_are_refused() -> None:
    samples = [Sample(str(i), turn(2, 0.3 * i, (0.1 * i, 0, 0)), turn(2, -0.3 * i)) for i in range(6)]
    with pytest.raises(CalibrationError, match="parallel axes"):
        solve_hand_eye(samples, "eye_on_base")


def test_moving_without_turning_is_refused() -> None:
    samples = [Sample(str(i), turn(2, 0.0, (0.1 * i, 0, 0)), turn(2, 0.0)) for i in range(6)]
    with pytest.raises(CalibrationError, match=r"turned by 0\.0 degrees"):
        solve_hand_eye(samples, "eye_on_base")


def test_names_that_do_not_exist_are_refused() -> None:
    samples = make_world("eye_on_base", 5).samples
    with pytest.raises(CalibrationError, match="did you mean 'daniilidis'"):
        solve_hand_eye(samples, "eye_on_base", "danilidis")  # type: ignore[arg-type]
    with pytest.raises(CalibrationError, match="unknown setup 'eye_to_hand'"):
        solve_hand_eye(samples, "eye_to_hand")  # type: ignore[arg-type]


@pytest.mark.parametrize("T", [np.full((4, 4), np.nan), np.eye(3), np.diag([1.0, 1.0, -1.0, 1.0]), 2 * np.eye(4)])
def test_a_pose_that_is_not_rigid_is_refused(T: np.ndarray) -> None:
    with pytest.raises(CalibrationError, match="T_base_tcp of sample 1"):
        Sample("1", T, np.eye(4))


def test_corners_of_the_board_are_24() -> None:
    assert CORNERS.shape == (24, 3)
