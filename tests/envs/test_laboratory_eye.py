"""The calibration laboratory photographed by SAPIEN's renderer."""

from __future__ import annotations

import numpy as np
import pytest

from tr_grasp.calibration import BoardSpec, Detection, Intrinsics, LabCfg, Laboratory, Setup, detect_board
from tr_grasp.calibration.rendering import INK, PAPER, exposed
from tr_grasp.calibration.rigid import distance_m, transform_of
from tr_grasp.envs.laboratory_eye import SapienEye, _without_lens, printed_board

pytestmark = pytest.mark.sim
LENS = Intrinsics(distortion=(0.12, -0.25, 0.001, -0.0005, 0.1))


@pytest.mark.parametrize("board", [BoardSpec(), BoardSpec(kind="charuco", columns_n=5, rows_n=4, gap_m=0.004)])
def test_as_much_is_black_and_white_as_is_printed(board: BoardSpec) -> None:
    body = printed_board(board)
    a, b, c = np.moveaxis(body.vertices[body.faces], 1, 0)
    normals = np.cross(b - a, c - a) / 2
    assert (normals[:, 2] < 0).all()  # the page faces -z, where the reader is
    areas, black = np.linalg.norm(normals, axis=1), np.isclose(body.face_colours[:, 0], INK / 255)
    left, top, right, bottom = board.black_board.T
    assert areas[black].sum() == pytest.approx(((right - left) * (bottom - top)).sum())
    page = np.ptp(board.outline_board, axis=0)
    assert areas.sum() == pytest.approx(page[0] * page[1])
    assert body.face_colours[~black] == pytest.approx(PAPER / 255)


def test_the_first_marker_begins_at_the_origin_with_its_black_border() -> None:
    """Worked by hand: a marker of DICT_5X5 has seven cells of 53 / 7 mm along an edge, the outer ones black."""
    board = BoardSpec()
    body = printed_board(board)
    centres = body.vertices[body.faces].mean(axis=1)
    cell = board.marker_m / 7
    ring = (centres[:, :2] > 0).all(axis=1) & (centres[:, :2] < board.marker_m).all(axis=1)
    border = ring & ((centres[:, :2] < cell) | (centres[:, :2] > board.marker_m - cell)).any(axis=1)
    assert border.any()
    assert body.face_colours[border] == pytest.approx(INK / 255)
    assert body.face_colours[(centres[:, :2] < 0).any(axis=1)] == pytest.approx(PAPER / 255)


@pytest.mark.parametrize("camera", [Intrinsics(), LENS], ids=["plain", "bent"])
def test_subpixels_are_looked_up_where_their_rays_meet_a_picture_without_a_lens(camera: Intrinsics) -> None:
    fov_rad, (width, height), columns, rows = _without_lens(camera)
    assert (columns.shape, rows.shape) == ((4 * camera.height_px, 4 * camera.width_px),) * 2
    assert columns.min() >= 0
    assert columns.max() <= width - 1
    assert rows.min() >= 0
    assert rows.max() <= height - 1
    focal = height / 2 / np.tan(fov_rad / 2)
    for row, column in ((0, 0), (700, 1300), (4 * camera.height_px - 1, 4 * camera.width_px - 1)):
        ray = [(columns[row, column] + 0.5 - width / 2) / focal, (rows[row, column] + 0.5 - height / 2) / focal, 1.0]
        pixel = np.array([(column + 0.5) / 4 - 0.5, (row + 0.5) / 4 - 0.5])
        assert camera.project(np.array([ray]))[0] == pytest.approx(pixel, abs=0.02)


@pytest.mark.render
@pytest.mark.parametrize("setup", ["eye_on_base", "eye_in_hand"])
def test_a_photograph_shows_the_board_where_the_truth_has_it_and_the_arm(setup: Setup) -> None:
    cfg = LabCfg(setup=setup, seed=1, camera=LENS)
    lab, cast = Laboratory(cfg, SapienEye(cfg.robot, cfg.board)), Laboratory(cfg)
    view = lab.choose_views(1, pool_n=1)[0]
    truth = lab.T_cam_board(lab.kinematics.pose(view.q_rad))
    picture = lab.shoot(view).picture
    seen = detect_board(picture, cfg.board, LENS)
    assert isinstance(seen, Detection)
    expected = LENS.project(seen.points_board @ truth[:3, :3].T + truth[:3, 3])
    assert np.sqrt(((seen.pixels - expected) ** 2).sum(1).mean()) < 0.15
    assert distance_m(seen.T_cam_board, truth) < 1e-3
    assert np.abs(picture.astype(float) - cast.shoot(view).picture).mean() > 5  # an arm and a table, no wall


@pytest.mark.render
def test_an_arm_before_the_board_hides_it() -> None:
    cfg = LabCfg()
    eye, q = SapienEye(cfg.robot, cfg.board), Laboratory(cfg).kinematics.home_q_rad
    corners = []
    for aside_m in (0.0, 0.6):  # the arm stands at the origin, the camera looks along y
        sight = transform_of([aside_m, -0.6, 0.15, 0, 0, 0]) @ transform_of([0, 0, 0, -np.pi / 2, 0, 0])
        board = sight @ transform_of([-0.055, -0.085, 0.75, 0, 0, 0])
        seen = detect_board(exposed(eye.picture(cfg.camera, sight, board, q)), cfg.board, cfg.camera)
        corners.append(len(seen.pixels) if isinstance(seen, Detection) else 0)
    assert corners[1] == 24
    assert corners[0] < 12
