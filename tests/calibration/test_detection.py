from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from tests.calibration.conftest import sight
from tr_grasp.calibration import (
    D415_COLOUR,
    BoardSpec,
    Detection,
    DetectionCfg,
    ImageNoise,
    Intrinsics,
    Reason,
    Refused,
    detect_board,
    render_board,
)
from tr_grasp.calibration.detection import pose_information
from tr_grasp.calibration.rigid import angle_rad, distance_m, transform_of
from tr_grasp.errors import CalibrationError

GRID = BoardSpec()
CHARUCO = BoardSpec(kind="charuco", columns_n=5, rows_n=7, marker_m=0.022, gap_m=0.004)
T_CAM_BOARD = transform_of([-0.05, -0.08, 0.55, 0.3, -0.25, 0.2])
PICTURE = render_board(GRID, T_CAM_BOARD, D415_COLOUR)


def found(picture: np.ndarray, board: BoardSpec = GRID, camera: Intrinsics = D415_COLOUR) -> Detection:
    seen = detect_board(picture, board, camera)
    assert isinstance(seen, Detection), seen
    return seen


def refused(picture: np.ndarray, reason: Reason, board: BoardSpec = GRID, **options: object) -> str:
    seen = detect_board(picture, board, D415_COLOUR, **options)  # type: ignore[arg-type]
    assert isinstance(seen, Refused)
    assert seen.reason is reason
    return seen.sentence


@pytest.mark.parametrize("board", [GRID, CHARUCO])
def test_a_board_is_found_where_it_is(board: BoardSpec) -> None:
    rng = np.random.default_rng(1)
    for _ in range(3):
        T = sight(rng)
        seen = found(render_board(board, T, D415_COLOUR), board)
        truth = D415_COLOUR.project(seen.points_board @ T[:3, :3].T + T[:3, 3])
        assert np.sqrt(((seen.pixels - truth) ** 2).sum(1).mean()) < 0.1
        assert distance_m(seen.T_cam_board, T) < 1.5e-3
        assert angle_rad(seen.T_cam_board, T) < 4e-3


def test_noise_of_the_camera_costs_hundredths_of_a_pixel() -> None:
    noisy = render_board(GRID, T_CAM_BOARD, D415_COLOUR, ImageNoise(levels=6), np.random.default_rng(0))
    seen = found(noisy)
    assert seen.reprojection_px < 0.1
    assert distance_m(seen.T_cam_board, T_CAM_BOARD) < 1e-3


def test_corners_are_nearer_than_those_of_a_corner_finder() -> None:
    seen = found(PICTURE)
    truth = D415_COLOUR.project(seen.points_board @ T_CAM_BOARD[:3, :3].T + T_CAM_BOARD[:3, 3])
    window = cv2.cornerSubPix(
        cv2.cvtColor(PICTURE, cv2.COLOR_RGB2GRAY),
        truth.astype(np.float32).reshape(-1, 1, 2),
        (5, 5),
        (-1, -1),
        (cv2.TERM_CRITERIA_COUNT, 30, 0.01),
    ).reshape(-1, 2)
    assert np.abs(seen.pixels - truth).mean() < 0.2 * np.abs(window - truth).mean()


def test_a_pixel_is_the_mean_of_what_it_covers() -> None:
    # A board that faces the camera, one texel of 53 mm edge at 0.616 m is 53 px wide: edges fall between pixels.
    T = transform_of([-0.0265, -0.0265, 0.616, 0, 0, 0])
    row = render_board(GRID, T, D415_COLOUR, ImageNoise(blur_px=0.0))[300, :, 0].astype(float)
    left = D415_COLOUR.cx_px - 26.5  # 293.0: the middle of pixel 293, so half of it is white
    assert left == 293.0
    assert row[294] < 30
    assert row[293] == pytest.approx((row[292] + row[294]) / 2, abs=2)


def test_information_is_the_slope_of_the_pixels_squared() -> None:
    points = np.concatenate(list(GRID.marker_corners_board.values()))

    def pixels(T: np.ndarray) -> np.ndarray:
        return D415_COLOUR.project(points @ T[:3, :3].T + T[:3, 3]).ravel()

    J = np.stack([(pixels(T_CAM_BOARD @ transform_of(d)) - pixels(T_CAM_BOARD)) / 1e-6 for d in 1e-6 * np.eye(6)], 1)
    assert pose_information(T_CAM_BOARD, points, D415_COLOUR) == pytest.approx(J.T @ J, rel=1e-3, abs=1.0)


def test_a_wall_has_no_board() -> None:
    wall = render_board(GRID, transform_of([0, 0, 0.5, np.pi, 0, 0]), D415_COLOUR)  # its back
    assert "bring it into view" in refused(wall, Reason.NOT_VISIBLE)


def test_a_board_half_out_of_sight_is_not_taken() -> None:
    hidden = PICTURE.copy()
    hidden[:, 330:] = 90
    assert "show all of it" in refused(hidden[:, :, :], Reason.NOT_VISIBLE, replace(GRID, rows_n=5))


def test_another_dictionary_is_named() -> None:
    sentence = refused(PICTURE, Reason.WRONG_DICTIONARY, BoardSpec(dictionary="DICT_4X4_50"))
    assert "DICT_5X5" in sentence
    assert "given as DICT_4X4_50" in sentence


def test_a_mirrored_picture_is_noticed() -> None:
    assert "mirrored" in refused(np.ascontiguousarray(PICTURE[:, ::-1]), Reason.MIRRORED)


def test_a_blurred_picture_is_noticed() -> None:
    blurred = render_board(GRID, T_CAM_BOARD, D415_COLOUR, ImageNoise(blur_px=2.0))
    assert "hold still" in refused(blurred, Reason.BLURRED)
    shaken = cv2.filter2D(PICTURE, -1, np.full((1, 11), 1 / 11))
    assert "edges are 1.7 pixels wide" in refused(shaken, Reason.BLURRED)


def test_a_board_with_more_markers_is_noticed() -> None:
    assert "markers 4, 5 are not on this board" in refused(PICTURE, Reason.WRONG_BOARD, replace(GRID, rows_n=2))


def test_another_gap_is_noticed() -> None:
    assert "measure marker and gap" in refused(PICTURE, Reason.WRONG_BOARD, replace(GRID, gap_m=0.010))


def test_another_size_is_noticed_where_there_is_depth() -> None:
    u, v = np.meshgrid(np.arange(640), np.arange(480))
    normal = T_CAM_BOARD[:3, 2]
    rays = np.stack([(u - D415_COLOUR.cx_px) / 616, (v - D415_COLOUR.cy_px) / 616, np.ones_like(u)], -1)
    depth = (normal @ T_CAM_BOARD[:3, 3]) / (rays @ normal)
    assert isinstance(detect_board(PICTURE, GRID, D415_COLOUR, depth_m=depth), Detection)
    smaller = replace(GRID, marker_m=0.053 / 1.1, gap_m=0.005 / 1.1)
    assert "probably 53.0 mm, not 48.2 mm" in refused(PICTURE, Reason.WRONG_SIZE, smaller, depth_m=depth)


def test_a_board_far_away_is_not_taken() -> None:
    """A marker of 53 mm at 2 m is 616 * 0.053 / 2 = 16 pixels wide seen head-on; this one is turned a little."""
    far, further = (render_board(GRID, transform_of([-0.05, -0.08, z, 0.2, 0, 0]), D415_COLOUR) for z in (2.0, 3.2))
    assert "15 pixels wide, 20 are needed" in refused(far, Reason.TOO_SMALL, cfg=DetectionCfg(marker_px=20.0))
    assert "near and sharp" in refused(further, Reason.NOT_VISIBLE)


def test_a_picture_of_another_size_is_refused() -> None:
    with pytest.raises(CalibrationError, match="320 x 240 pixels, the camera 640 x 480"):
        detect_board(PICTURE[::2, ::2], GRID, D415_COLOUR)
    with pytest.raises(CalibrationError, match="must be uint8"):
        detect_board(PICTURE.astype(float), GRID, D415_COLOUR)


def test_lenses_are_undistorted() -> None:
    camera = replace(D415_COLOUR, distortion=(-0.2, 0.05, 0.0, 0.0, 0.0))
    # Each pixel of the distorted picture shows what the plain one has where its ray goes.
    grid = np.stack(np.meshgrid(np.arange(640.0), np.arange(480.0)), -1).reshape(-1, 1, 2)
    plain = cv2.undistortPoints(grid, camera.matrix, camera.coefficients, P=D415_COLOUR.matrix).reshape(480, 640, 2)
    bent = cv2.remap(PICTURE, plain.astype(np.float32), None, cv2.INTER_CUBIC)
    seen = found(bent, camera=camera)
    assert distance_m(seen.T_cam_board, T_CAM_BOARD) < 1.5e-3
    assert distance_m(found(bent).T_cam_board, T_CAM_BOARD) > 2 * distance_m(seen.T_cam_board, T_CAM_BOARD)
