from __future__ import annotations

import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from tr_grasp.calibration import BoardSpec, print_board
from tr_grasp.calibration.rendering import INK, PAPER, _texture
from tr_grasp.errors import CalibrationError

GRID = BoardSpec()
CHARUCO = BoardSpec(kind="charuco", columns_n=5, rows_n=7, marker_m=0.022, gap_m=0.004)


def test_the_grid_of_the_thesis_measures_111_by_169_mm() -> None:
    assert GRID.size_m == pytest.approx((0.111, 0.169))
    assert GRID.markers_n == 6
    # Marker 3 is the right one of the second row: one pitch (58 mm) to the right and one down.
    assert GRID.marker_corners_board[3][0] == pytest.approx([0.058, 0.058, 0])
    assert GRID.marker_corners_board[3][2] == pytest.approx([0.111, 0.111, 0])


@pytest.mark.parametrize("board", [GRID, CHARUCO])
def test_what_is_printed_is_what_opencv_draws(board: BoardSpec) -> None:
    scale = 2000  # pixels per metre, at which cells are whole pixels to a tenth
    size = tuple(round(edge * scale) for edge in board.size_m)
    theirs = board.cv_board.generateImage(size, marginSize=0) < 128
    ours = np.zeros(size[::-1], bool)
    for left, top, right, bottom in np.rint(board.black_board * scale).astype(int):
        ours[top:bottom, left:right] = True
    assert (ours != theirs).mean() < 0.02
    shrunk = [cv2.erode((ours != theirs).astype(np.uint8), np.ones((4, 4))) for _ in range(1)]
    assert not shrunk[0].any()  # they differ along edges only


def test_ink_on_the_rendered_board_is_the_ink_of_the_printed_one() -> None:
    texture = _texture(GRID)
    share = (PAPER - texture.mean()) / (PAPER - INK)
    left, top, right, bottom = GRID.black_board.T
    w, h = (edge + 2 * GRID.margin_m for edge in GRID.size_m)
    assert share == pytest.approx(((right - left) * (bottom - top)).sum() / (w * h), rel=1e-3)


def test_a_png_has_its_true_scale(tmp_path: Path) -> None:
    path = print_board(GRID, tmp_path / "board.png", dpi=300)
    with Image.open(path) as image:
        assert image.info["dpi"] == pytest.approx((300, 300), abs=0.01)
        black = np.asarray(image.convert("L")) < 100
    pattern = np.flatnonzero(black[:, : black.shape[1]].sum(1) > 300)
    rows = pattern[pattern < 0.8 * len(black)]
    assert (rows[-1] - rows[0] + 1) / 300 * 25.4 == pytest.approx(169, abs=0.1)
    columns = np.flatnonzero(black[rows[0] : rows[-1]].any(0))
    assert (columns[-1] - columns[0] + 1) / 300 * 25.4 == pytest.approx(111, abs=0.1)


def test_a_pdf_is_a_page_of_a4(tmp_path: Path) -> None:
    content = print_board(CHARUCO, tmp_path / "deep" / "board.pdf").read_bytes()
    width, height = (float(v) for v in re.search(rb"/MediaBox \[ ?0 0 ([\d.]+) ([\d.]+)", content).groups())  # type: ignore[union-attr]
    assert (width, height) == pytest.approx((210 / 25.4 * 72, 297 / 25.4 * 72), abs=0.1)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"dictionary": "DICT_5x5_250"}, "did you mean 'DICT_5X5_250'"),
        ({"columns_n": 0}, "1 or more columns and rows"),
        ({"columns_n": 1, "rows_n": 1}, "one marker alone"),
        ({"marker_m": 0.0}, "must be positive"),
        ({"columns_n": 20, "rows_n": 20}, "has 250 markers, this board needs 400"),
    ],
)
def test_a_board_that_cannot_be_is_refused(changes: dict, sentence: str) -> None:
    with pytest.raises(CalibrationError, match=re.escape(sentence)):
        BoardSpec(**changes)


@pytest.mark.parametrize(
    ("board", "name", "options", "sentence"),
    [
        (GRID, "board.jpg", {}, ".pdf or .png"),
        (GRID, "board.pdf", {"paper": "a5"}, "unknown paper"),
        (GRID, "board.png", {"dpi": 10}, "dpi must be"),
        (BoardSpec(columns_n=6, rows_n=8), "board.pdf", {}, "does not fit on a4"),
    ],
)
def test_a_page_that_cannot_be_is_refused(tmp_path: Path, board: BoardSpec, name: str, options: dict, sentence: str):
    with pytest.raises(CalibrationError, match=re.escape(sentence)):
        print_board(board, tmp_path / name, **options)
