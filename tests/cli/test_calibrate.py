"""``tr-grasp calibrate``: every part of it, as a user would go through them."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
import yaml

import tr_grasp.cli as cli
from tr_grasp.calibration import HandEyeSession, load_calibration


def run(*args: object) -> int:
    return cli.main(["calibrate", *map(str, args)])


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session of the simulated laboratory, made by the command itself."""
    folder = tmp_path_factory.mktemp("calibrate") / "sim"
    assert run("simulate", "--samples", 4, "--out", folder, "--lab.seed", 2) == 0
    return folder


def joints(folder: Path, name: str) -> list[str]:
    return [str(q) for q in json.loads((folder / "samples" / f"{name}.json").read_text())["q_rad"]]


def test_the_simulated_laboratory_finds_its_camera(simulated: Path) -> None:
    record = load_calibration(simulated / "calibration.yaml")
    assert (record.setup, record.samples_n, record.outliers) == ("eye_on_base", 4, ())
    html = (simulated / "report.html").read_text()
    assert float(re.search(r"The truth of this simulation is ([\d.]+) mm", html).group(1)) < 1.5  # type: ignore[union-attr]


def test_a_wrong_sample_and_a_lens_are_told(tmp_path: Path, capsys) -> None:
    flags = [
        "--lab.camera.distortion", "0.1", "-0.2", "0", "0", "0", "--lab.intrinsics-error.focal", "0.001",
        "--lab.wrong-samples-n", "1", "--lab.image.levels", "4", "--samples", "5",
    ]  # fmt: skip
    assert run("simulate", "--out", tmp_path, *flags) == 0
    out = capsys.readouterr().out
    wrong = re.search(r"sample (\d+): .* wrong on purpose", out).group(1)  # type: ignore[union-attr]
    assert f"look: sample {wrong} contradicts the others and was left out" in out
    session = HandEyeSession.open(tmp_path)
    assert session.cfg.camera.distortion == (0.1, -0.2, 0.0, 0.0, 0.0)
    assert session.cfg.camera.fx_px != 616.0


def test_photographs_are_refused_without_a_vulkan_device(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys
) -> None:
    monkeypatch.setattr("tr_grasp.cli.vulkan.probe_vulkan", lambda: ("", "no driver"))
    assert run("simulate", "--pictures", "sapien", "--out", tmp_path / "new") == 2
    assert "--pictures sapien needs a Vulkan device (no driver); --pictures raycast" in capsys.readouterr().err
    assert not (tmp_path / "new").exists()


@pytest.mark.sim
@pytest.mark.render
def test_a_camera_is_found_from_photographs_too(tmp_path: Path) -> None:
    assert run("simulate", "--pictures", "sapien", "--samples", 3, "--out", tmp_path, "--lab.seed", 2) == 0
    html = (tmp_path / "report.html").read_text()
    assert float(re.search(r"The truth of this simulation is ([\d.]+) mm", html).group(1)) < 1.5  # type: ignore[union-attr]


def test_a_session_goes_from_the_first_picture_to_a_calibration(simulated: Path, tmp_path: Path, capsys) -> None:
    lab = tmp_path / "lab"
    assert run("new", lab, "--session.frames.cam", "camera_color_optical_frame") == 0
    truth = HandEyeSession.open(simulated)
    arm = ["--robot", "j2s7s300"]
    assert run("add", lab, truth.picture_path(truth.samples[0]), "--joints", *joints(simulated, "001"), *arm) == 0
    capsys.readouterr()

    assert run("status", lab, *arm) == 2
    assert "say it roughly (X_rough, --camera-at and --looks-at): too few samples" in capsys.readouterr().err
    camera = ["--camera-at", "0.05", "-1.15", "0.62", "--looks-at", "0", "-0.48", "0.45"]
    assert run("status", lab, *arm, *camera) == 0
    out = capsys.readouterr().out
    assert "missing: take 9 more" in out
    assert len(re.search(r"go next to joints \[rad\]  (.*)", out).group(1).split()) == 7  # type: ignore[union-attr]

    for sample in truth.samples[1:]:
        assert run("add", lab, truth.picture_path(sample), "--joints", *joints(simulated, sample.name), *arm) == 0
    assert run("add", lab, truth.picture_path(truth.samples[0]), "--joints", *joints(simulated, "001"), *arm) == 1
    assert "not taken, pose repeated" in capsys.readouterr().out
    assert run("status", lab, *arm) == 0
    assert "where T_base_tcp is" in capsys.readouterr().out

    assert run("solve", lab) == 0
    out = capsys.readouterr().out
    assert "--frame-id base --child-frame-id camera_color_optical_frame" in out
    solved, simulation = (load_calibration(folder / "calibration.yaml") for folder in (lab, simulated))
    assert np.abs(solved.T_parent_cam - simulation.T_parent_cam).max() < 1e-6

    (lab / "report.html").unlink()
    assert run("report", lab, "--refine", "False") == 0
    assert capsys.readouterr().out.strip() == str(lab / "report.html")
    assert "not refined" in (lab / "report.html").read_text()


def test_a_pose_is_told_as_position_and_quaternion(simulated: Path, tmp_path: Path, capsys) -> None:
    run("new", tmp_path)
    picture = simulated / "samples" / "001.png"
    assert run("add", tmp_path, picture, "--pose", 0.1, -0.5, 0.4, 0, 1, 0, 0) == 0
    sample = HandEyeSession.open(tmp_path).samples[0]
    expected = [[1, 0, 0, 0.1], [0, -1, 0, -0.5], [0, 0, -1, 0.4], [0, 0, 0, 1]]
    np.testing.assert_allclose(sample.T_base_tcp, expected, atol=1e-12)


def test_boards_are_printed(tmp_path: Path, capsys) -> None:
    assert run("board", tmp_path / "new" / "board.pdf") == 0
    assert run("board", tmp_path / "board.png", "--dpi", 100, "--board.marker-m", 0.04) == 0
    assert "Print it at 100 %" in capsys.readouterr().out
    assert (tmp_path / "new" / "board.pdf").read_bytes()[:5] == b"%PDF-"
    assert (tmp_path / "board.png").read_bytes()[1:4] == b"PNG"


def test_samples_of_another_tool_become_a_session(simulated: Path, tmp_path: Path, capsys) -> None:
    file, folder = tmp_path / "moveit.yaml", tmp_path / "imported"
    samples = [
        {"effector_wrt_world": s.T_base_tcp.ravel().tolist(), "object_wrt_sensor": s.T_cam_board.ravel().tolist()}
        for s in HandEyeSession.open(simulated).samples
    ]
    file.write_text(yaml.safe_dump(samples))
    assert run("import", file, folder) == 2
    assert "give --setup eye_on_base or eye_in_hand" in capsys.readouterr().err
    assert run("import", file, folder, "--setup", "eye_on_base") == 0
    assert "4 samples, eye_on_base" in capsys.readouterr().out
    assert run("solve", folder) == 0
    far = np.abs(
        load_calibration(folder / "calibration.yaml").T_parent_cam
        - load_calibration(simulated / "calibration.yaml").T_parent_cam
    )
    assert far.max() < 2e-3


def test_help_lists_the_parts(capsys) -> None:
    assert run() == 0
    out = capsys.readouterr().out
    for part in ("board", "simulate", "new", "add", "status", "solve", "report", "import"):
        assert f"\n  {part} " in out


@pytest.mark.parametrize(
    ("args", "sentence"),
    [
        (["sovle"], "unknown part of calibrate 'sovle'; did you mean 'solve'?"),
        (["solve", "nowhere"], "no session in 'nowhere'"),
        (["solve", "{lab}", "--method", "tsia"], "tsia"),
        (["add", "{lab}", "nothing.png", "--pose", "0", "0", "0", "1", "0", "0", "0"], "'nothing.png' cannot be read"),
        (["add", "{lab}", "{picture}"], "give either --pose or --joints"),
        (["add", "{lab}", "{picture}", "--joints", "0", "0"], "joints say nothing without --robot"),
        (["add", "{lab}", "{picture}", "--joints", "0", "0", "--robot", "j2s7s300"], "joints"),
        (["add", "{lab}", "{picture}", "--pose", "0", "0", "0", "0", "0", "0", "0"], "quaternion"),
        (["add", "{lab}", "{picture}", "--pose", "0", "0", "0", "2", "0", "0", "0"], "quaternion"),
        (["status", "{lab}", "--robot", "j2s7s301"], "j2s7s301"),
        (["status", "{lab}", "--robot", "j2s7s300", "--camera-at", "0", "0", "1"], "--looks-at together"),
        (
            ["status", "{lab}", "--robot", "j2s7s300", "--camera-at", "0", "0", "1", "--looks-at", "0", "0", "0"],
            "do not go together",
        ),
        (["new", "{lab}"], "holds a session already"),
        (["board", "board.jpg"], ".pdf or .png"),
        (["import", "{picture}", "other"], "001.png"),
        (["simulate", "--samples", "2", "--out", "{new}"], "too few samples"),
    ],
)
def test_a_mistake_is_one_sentence(simulated: Path, tmp_path: Path, args: list[str], sentence: str, capsys) -> None:
    places = {"lab": simulated, "picture": simulated / "samples" / "001.png", "new": tmp_path / "new"}
    assert run(*(arg.format(**places) for arg in args)) == 2
    err = capsys.readouterr().err
    assert sentence in err
    assert "Traceback" not in err
