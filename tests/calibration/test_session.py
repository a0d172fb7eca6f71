from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from tests.calibration.conftest import make_world
from tr_grasp.calibration import (
    BoardSpec,
    Frames,
    HandEyeSession,
    Intrinsics,
    Laboratory,
    Reason,
    Refused,
    Sample,
    SessionCfg,
    solve_hand_eye,
)
from tr_grasp.calibration.laboratory import Shot
from tr_grasp.calibration.rigid import angle_rad, distance_m, transform_of
from tr_grasp.errors import CalibrationError


@pytest.fixture
def session(tmp_path: Path, shots: list[Shot]) -> HandEyeSession:
    """With three samples."""
    session = HandEyeSession.create(tmp_path / "lab", SessionCfg())
    for shot in shots[:3]:
        session.add(shot.picture, shot.T_base_tcp, q_rad=shot.q_rad)
    return session


def test_a_session_that_is_opened_again_holds_what_was_put_in(session: HandEyeSession) -> None:
    again = HandEyeSession.open(session.folder)
    assert again.cfg == session.cfg
    for before, after in zip(session.samples, again.samples, strict=True):
        for name in ("T_base_tcp", "T_cam_board", "pixels", "points_board", "q_rad"):
            np.testing.assert_allclose(getattr(after, name), getattr(before, name), atol=1e-12)
        np.testing.assert_allclose(after.information, before.information, rtol=1e-9)
    assert [path.name for path in sorted((session.folder / "samples").iterdir())] == [
        f"00{i}.{ending}" for i in (1, 2, 3) for ending in ("json", "png")
    ]


def test_what_a_session_is_about_is_kept(tmp_path: Path) -> None:
    cfg = SessionCfg(
        "eye_in_hand",
        BoardSpec(kind="charuco", columns_n=5, rows_n=7, marker_m=0.022, gap_m=0.004),
        Intrinsics(1280, 720, 900.0, 901.0, 640.0, 360.0, (0.1, -0.2, 0.0, 0.0, 0.05)),
        Frames(base="world", tcp="tool0", cam="optical"),
    )
    HandEyeSession.create(tmp_path, cfg)
    assert HandEyeSession.open(tmp_path).cfg == cfg


def test_three_samples_of_a_laboratory_find_the_camera(session: HandEyeSession, lab: Laboratory) -> None:
    result = session.solve()
    assert distance_m(result.T_parent_cam, lab.X) < 1.5e-3
    assert angle_rad(result.T_parent_cam, lab.X) < 3.5e-3
    assert distance_m(result.T_parent_cam, solve_hand_eye(session.samples, "eye_on_base").T_parent_cam) == 0.0


def test_a_pose_that_was_there_already_is_not_taken(session: HandEyeSession, shots: list[Shot]) -> None:
    nearly = shots[1].T_base_tcp @ transform_of([0.001, 0, 0, 0, 0.01, 0])
    seen = session.add(shots[1].picture, nearly)
    assert isinstance(seen, Refused)
    assert seen.reason is Reason.REPEATED
    assert "where it was in sample 002 (to 1.0 mm and 0.6 degrees)" in seen.sentence
    assert len(HandEyeSession.open(session.folder).samples) == 3


def test_a_picture_without_a_board_leaves_the_session_as_it_was(session: HandEyeSession) -> None:
    seen = session.add(np.full((480, 640, 3), 90, np.uint8), np.eye(4))
    assert isinstance(seen, Refused)
    assert seen.reason is Reason.NOT_VISIBLE
    assert len(list((session.folder / "samples").iterdir())) == 6


def test_a_sample_that_was_taken_out_leaves_a_free_folder_and_its_number_is_not_used_again(
    session: HandEyeSession, shots: list[Shot]
) -> None:
    session.remove("002")
    assert [s.name for s in HandEyeSession.open(session.folder).samples] == ["001", "003"]
    added = session.add(shots[1].picture, shots[1].T_base_tcp)
    assert isinstance(added, Sample)
    assert added.name == "004"
    with pytest.raises(CalibrationError, match="unknown sample '002'"):
        session.remove("002")


def test_what_a_stopped_process_left_is_swept_away(session: HandEyeSession) -> None:
    # Its picture was written, its numbers only begun: the sample is as if it had not been taken.
    (session.folder / "samples" / "004.png").write_bytes(b"a picture")
    partial = session.folder / "samples" / ".004.json.x1y2.partial"
    partial.write_text('{"T_base_tcp": [[')
    assert len(HandEyeSession.open(session.folder).samples) == 3
    assert not partial.exists()


@pytest.mark.parametrize(
    ("damage", "sentence"),
    [
        ("{", "cannot be read"),
        ("[1, 2]", "holds no named values"),
        ("{}", "is damaged ('pixels')"),
        ({"T_base_tcp": None}, "a pose is missing"),
        ({"pixels": [[1.0, 2.0]]}, "corners and points do not belong together"),
        ({"T_cam_board": (2 * np.eye(4)).tolist()}, "is not rigid"),
    ],
)
def test_a_damaged_sample_is_named(session: HandEyeSession, damage: str | dict, sentence: str) -> None:
    path = session.folder / "samples" / "002.json"
    text = damage if isinstance(damage, str) else json.dumps({**json.loads(path.read_text()), **damage})
    path.write_text(text)
    with pytest.raises(CalibrationError, match=re.escape(sentence)) as caught:
        HandEyeSession.open(session.folder)
    assert "002" in str(caught.value)


def test_a_folder_without_a_session_or_with_another_one_is_refused(session: HandEyeSession, tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match=r"no session in .* it has no session\.json"):
        HandEyeSession.open(tmp_path)
    with pytest.raises(CalibrationError, match="holds a session already"):
        HandEyeSession.create(session.folder, SessionCfg())
    with pytest.raises(CalibrationError, match="unknown setup 'on_base'"):
        HandEyeSession.create(tmp_path / "other", SessionCfg("on_base"))  # type: ignore[arg-type]
    (session.folder / "session.json").write_text('{"setup": "eye_on_base", "bord": {}}')
    with pytest.raises(CalibrationError, match="bord"):
        HandEyeSession.open(session.folder)


def test_the_place_of_the_camera_is_solved_as_soon_as_samples_allow(session: HandEyeSession, lab: Laboratory) -> None:
    X, Z = session.place()
    assert distance_m(X, lab.X) < 1.5e-3
    assert distance_m(Z, lab.Z) < 1.5e-3


def test_before_that_one_sample_and_a_rough_camera_place_the_board(session: HandEyeSession, lab: Laboratory) -> None:
    session.remove("003")
    X, Z = session.place(lab.X_rough)
    assert X is lab.X_rough
    assert distance_m(Z, lab.Z) < 0.1
    session.remove("002")
    with pytest.raises(CalibrationError, match="where the camera is; say it roughly"):
        session.place()
    session.remove("001")
    with pytest.raises(CalibrationError, match="no sample yet"):
        session.place(lab.X_rough)


def test_a_suggestion_is_a_pose_from_which_the_next_sample_is_taken(session: HandEyeSession, lab: Laboratory) -> None:
    session.remove("003")
    session.remove("002")
    view = session.suggest(lab.kinematics, *session.place(lab.X_rough), np.random.default_rng(0))
    shot = lab.shoot(view)
    before = session.coverage.turn_deg
    assert isinstance(session.add(shot.picture, shot.T_base_tcp), Sample)
    assert before == 0.0
    assert session.coverage.turn_deg > 20


def test_samples_of_poses_alone_are_a_session_too(tmp_path: Path) -> None:
    world = make_world("eye_in_hand", 5)
    session = HandEyeSession.create(tmp_path, SessionCfg("eye_in_hand"))
    for sample in world.samples:
        session.add_poses(sample.T_base_tcp, sample.T_cam_board)
    assert distance_m(HandEyeSession.open(tmp_path).solve().T_parent_cam, world.X) < 1e-6
