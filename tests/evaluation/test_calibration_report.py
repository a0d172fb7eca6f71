"""The report of a calibration, from a session with pictures and from one without."""

from __future__ import annotations

import base64
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import cv2
import imageio.v3 as imageio
import numpy as np
import pytest

from tests.calibration.conftest import make_world, project
from tr_grasp.calibration import D415_COLOUR, BoardSpec, HandEyeSession, SessionCfg, render_board, solve_hand_eye
from tr_grasp.calibration.overlay import EXPECTED, SEEN, draw_overlay, expected_error_px
from tr_grasp.calibration.rigid import transform_of
from tr_grasp.evaluation.calibration_report import calibration_html
from tr_grasp.provenance import Provenance, provenance

BOARD = BoardSpec()


@pytest.fixture(scope="module")
def source() -> Provenance:
    return provenance("tr-grasp calibrate solve <lab> & more")


def session_of(folder: Path, seed: int = 0) -> HandEyeSession:
    """Three samples with pictures that show the board where it was seen."""
    world = make_world("eye_in_hand", 3, seed)
    session = HandEyeSession.create(folder, SessionCfg("eye_in_hand"))
    for sample in world.samples:
        session.add(render_board(BOARD, sample.T_cam_board, D415_COLOUR), sample.T_base_tcp)
    assert len(session.samples) == 3
    return session


class Checker(HTMLParser):
    """Open tags are closed in order."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []

    def handle_starttag(self, tag: str, attrs) -> None:
        if tag not in ("meta", "img", "br"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_the_report_is_one_page_with_a_picture_for_each_sample(tmp_path: Path, source: Provenance) -> None:
    session = session_of(tmp_path)
    result = session.solve()
    html = calibration_html(session, result, source, truth=result.T_parent_cam)
    checker = Checker()
    checker.feed(html)
    assert checker.open == []
    pictures = re.findall(r'src="data:image/jpeg;base64,([^"]+)"', html)
    assert len(pictures) == 3
    shown = imageio.imread(base64.b64decode(pictures[0]), extension=".jpg")
    assert shown.shape == (960, 1280, 3)
    assert not re.search(r'(src|href)="http', html)  # it needs nothing from elsewhere
    assert "camera in the hand" in html
    assert "The truth of this simulation is 0.00 mm" in html
    assert "static_transform_publisher" in html
    assert "take 7 more" in html
    assert "&lt;lab&gt; &amp; more" in html


def test_a_sample_that_was_left_out_is_marked(tmp_path: Path, source: Provenance) -> None:
    world = make_world("eye_on_base", 8, 7, 0.1, (2e-4, 5e-4))
    slipped = world.samples[3].T_base_tcp @ transform_of([0.02, -0.01, 0.02, 0.05, 0.05, 0])
    session = HandEyeSession.create(tmp_path, SessionCfg())
    session.samples = [replace(s, T_base_tcp=slipped) if s.name == "3" else s for s in world.samples]
    html = calibration_html(session, session.solve(), source)
    assert html.count("left out</strong>") == 1
    assert "sample 3 contradicts the others" in html
    assert "data:image" not in html
    assert "camera beside the robot" in html


def test_a_session_of_poses_alone_has_a_report_without_pictures(tmp_path: Path, source: Provenance) -> None:
    session = HandEyeSession.create(tmp_path, SessionCfg("eye_in_hand"))
    for sample in make_world("eye_in_hand", 4).samples:
        session.add_poses(sample.T_base_tcp, sample.T_cam_board)
    html = calibration_html(session, session.solve(), source)
    assert "data:image" not in html
    assert "The truth" not in html


def test_what_was_seen_and_what_is_expected_lie_on_each_other_where_the_calibration_is_right() -> None:
    world = make_world("eye_on_base", 3)
    sample = world.samples[0]
    grey = np.full((480, 640, 3), 128, np.uint8)
    right = draw_overlay(grey, sample, sample.T_cam_board, BOARD, D415_COLOUR)
    u, v = np.rint((project(sample.T_cam_board)[5] + 0.5) * 2 - 0.5).astype(int)
    assert np.abs(right[v, u].astype(int) - EXPECTED).max() < 40
    ring = right[v, u - 6].astype(int), right[v, u + 6].astype(int)
    assert min(np.abs(colour - SEEN).max() for colour in ring) < 60
    assert expected_error_px(sample, sample.T_cam_board, D415_COLOUR) == pytest.approx(0.0, abs=1e-6)


def test_the_error_in_pixels_worked_by_hand() -> None:
    # 1 mm to the right at 0.616 m is one pixel for f = 616.
    world = make_world("eye_on_base", 3)
    facing = transform_of([-0.05, -0.08, 0.616, 0, 0, 0])
    sample = replace(world.samples[0], T_cam_board=facing, pixels=project(facing))
    shifted = transform_of([0.001, 0, 0, 0, 0, 0]) @ facing
    assert expected_error_px(sample, shifted, D415_COLOUR) == pytest.approx(1.0)
    bare = replace(sample, pixels=None, points_board=None)
    assert expected_error_px(bare, shifted, D415_COLOUR) is None


def test_corners_are_seen_where_the_picture_has_them() -> None:
    T = transform_of([-0.05, -0.08, 0.6, 0.3, 0, 0.2])
    picture = render_board(BOARD, T, D415_COLOUR)
    grey = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)
    u, v = np.rint(project(T)[0]).astype(int)
    assert np.ptp(grey[v - 2 : v + 3, u - 2 : u + 3].astype(int)) > 80  # an edge of ink goes through it
    assert solve_hand_eye(make_world("eye_on_base", 3).samples, "eye_on_base", draws_n=10).outliers == []
