from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tr_grasp.calibration import Detection, ImageNoise, Intrinsics, LabCfg, Laboratory, Setup, coverage_of, detect_board
from tr_grasp.calibration.laboratory import IntrinsicsError, Shot
from tr_grasp.calibration.rigid import angle_rad, distance_m
from tr_grasp.calibration.samples import Sample
from tr_grasp.calibration.views import View
from tr_grasp.errors import CalibrationError


def test_pictures_show_the_board_where_the_truth_has_it(lab: Laboratory, shots: list[Shot]) -> None:
    for shot in shots[:3]:
        seen = detect_board(shot.picture, lab.cfg.board, lab.cfg.camera)
        assert isinstance(seen, Detection)
        truth = lab.T_cam_board(lab.kinematics.pose(shot.q_rad))
        assert distance_m(seen.T_cam_board, truth) < 5e-4
        assert angle_rad(seen.T_cam_board, truth) < 2e-3


def test_an_eye_is_told_where_camera_board_and_joints_truly_are(setup: Setup) -> None:
    class Plain:
        def picture(self, camera, T_base_cam, T_base_board, q_rad):
            self.told = T_base_cam, T_base_board, q_rad
            return np.full((camera.height_px, camera.width_px, 3), 100.4, np.float32)

    eye = Plain()
    lab = Laboratory(LabCfg(setup=setup, seed=1), eye)
    q = lab.kinematics.home_q_rad
    hand = lab.kinematics.pose(q)
    shot = lab.shoot(View(hand, q, np.eye(4)))
    T_base_cam, T_base_board, joints = eye.told
    moved, still = (T_base_board, T_base_cam) if setup == "eye_on_base" else (T_base_cam, T_base_board)
    assert moved == pytest.approx(hand @ (lab.Z if setup == "eye_on_base" else lab.X))
    assert still == pytest.approx(lab.X if setup == "eye_on_base" else lab.Z)
    assert joints is q
    assert (shot.picture == 100).all()
    assert np.linalg.inv(T_base_cam) @ T_base_board == pytest.approx(lab.T_cam_board(hand))


def test_views_of_a_camera_in_the_hand_turn_it_about_every_axis() -> None:
    lab = Laboratory(LabCfg(setup="eye_in_hand", seed=3))
    views = lab.choose_views(6, pool_n=1)
    coverage = coverage_of([Sample("", view.T_base_tcp, view.T_cam_board) for view in views])
    assert coverage.degenerate is None
    assert min(coverage.turns_deg) > 30
    with pytest.raises(CalibrationError, match="500 views were asked for, the arm reaches"):
        lab.choose_views(500, pool_n=1)


def test_the_same_seed_is_the_same_laboratory(setup: Setup) -> None:
    first, second, other = (Laboratory(LabCfg(setup=setup, seed=seed)) for seed in (5, 5, 6))
    np.testing.assert_array_equal(first.X, second.X)
    np.testing.assert_array_equal(first.told(np.eye(4)), second.told(np.eye(4)))
    assert distance_m(first.X, other.X) > 1e-3


def test_a_rough_camera_is_off_by_what_it_says(lab: Laboratory) -> None:
    assert distance_m(lab.X_rough, lab.X) == pytest.approx(0.030)
    assert angle_rad(lab.X_rough, lab.X) == pytest.approx(np.radians(4.0))


def test_the_robot_tells_its_pose_with_the_noise_that_was_asked_for(lab: Laboratory) -> None:
    exact = lab.told(np.eye(4))
    np.testing.assert_array_equal(exact, np.eye(4))
    noisy = lab.with_cfg(kinematics_position_m=1e-3, kinematics_rotation_deg=0.5)
    told = np.array([noisy.told(np.eye(4)) for _ in range(400)])
    assert told[:, :3, 3].std(axis=0) == pytest.approx([1e-3] * 3, rel=0.15)
    assert np.degrees(told[:, 1, 0].std()) == pytest.approx(0.5, rel=0.15)  # a small turn about z
    wrong = lab.told(np.eye(4), is_wrong=True)
    assert distance_m(wrong, np.eye(4)) == pytest.approx(0.030)
    assert angle_rad(wrong, np.eye(4)) == pytest.approx(np.radians(5.0))


def test_as_many_shots_are_wrong_as_were_asked_for(lab: Laboratory) -> None:
    views = lab.choose_views(4, pool_n=1)
    shots = lab.with_cfg(wrong_samples_n=2).shoot_all(views)
    assert sum(shot.is_wrong for shot in shots) == 2
    for shot in shots:
        off = distance_m(shot.T_base_tcp, lab.kinematics.pose(shot.q_rad))
        assert off == pytest.approx(0.030 if shot.is_wrong else 0.0)


def test_noise_of_the_picture_is_the_noise_that_was_asked_for(lab: Laboratory) -> None:
    view = lab.choose_views(1, pool_n=1)[0]
    quiet, loud = (lab.with_cfg(image=ImageNoise(levels=level)).shoot(view).picture for level in (0.0, 5.0))
    apart = loud.astype(float) - quiet
    assert apart.std() == pytest.approx(5.0, rel=0.05)
    assert apart.mean() == pytest.approx(0.0, abs=0.1)


def test_intrinsics_are_told_exactly_unless_asked_otherwise(lab: Laboratory) -> None:
    assert lab.told_camera == lab.cfg.camera
    lens = replace(lab.cfg.camera, distortion=(0.1, -0.2, 0.0, 0.0, 0.1))
    inexact = lab.with_cfg(camera=lens, intrinsics_error=IntrinsicsError(0.002, 1.0, 0.25))
    told = inexact.told_camera
    assert told == inexact.told_camera  # as often as one asks
    assert 0 < abs(told.fx_px / lens.fx_px - 1) < 0.01
    assert told.fx_px / lens.fx_px == told.fy_px / lens.fy_px
    assert 0 < abs(told.cx_px - lens.cx_px) < 4
    assert told.distortion == pytest.approx((0.075, -0.15, 0.0, 0.0, 0.075))


def test_a_lens_bends_the_picture_as_opencv_says(lab: Laboratory) -> None:
    lens = Intrinsics(distortion=(0.12, -0.25, 0.001, -0.0005, 0.1))
    bent = lab.with_cfg(camera=lens)
    view = lab.choose_views(1, pool_n=1)[0]
    picture = bent.shoot(view).picture
    truth = lab.T_cam_board(lab.kinematics.pose(view.q_rad))
    seen = detect_board(picture, lab.cfg.board, lens)
    assert isinstance(seen, Detection)
    at = lens.project(seen.points_board @ truth[:3, :3].T + truth[:3, 3])
    assert np.abs(seen.pixels - at).max() < 0.1
    straight = lab.cfg.camera.project(seen.points_board @ truth[:3, :3].T + truth[:3, 3])
    assert np.abs(seen.pixels - straight).max() > 0.3
