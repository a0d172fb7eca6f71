"""``tr-grasp demos``."""

from __future__ import annotations

from pathlib import Path

import pytest

import tr_grasp.cli as cli
from tests.trainers.test_demonstrations import record
from tr_grasp.cli.demos import RecordCfg, _recording


def test_a_file_is_summed_up(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = record(tmp_path / "demos.h5", range(4))
    assert cli.main(["demos", "info", str(tmp_path / "demos.h5")]) == 0
    lines = dict(line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines())
    assert lines["episodes"] == f"4, {file.transitions_n} transitions"
    assert lines["robot"] == "panda"
    assert lines["seeds"] == "0 to 3"
    assert lines["noise"] == "0.3, 0.6"
    assert lines["commits"] == "abc"
    assert lines["success"].endswith("%)")


def test_a_file_is_exported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("pyarrow")
    record(tmp_path / "demos.h5", range(2))
    assert cli.main(["demos", "export", str(tmp_path / "demos.h5"), "--out", str(tmp_path / "set")]) == 0
    assert "2 episodes" in capsys.readouterr().out
    assert (tmp_path / "set/meta/info.json").is_file()


def test_what_is_recorded_follows_the_preset_and_the_flags(tmp_path: Path) -> None:
    how = _recording(RecordCfg(robot="ur5_rg2", suite="single"))
    assert (how.env.robot, how.env.objects.count_range) == ("ur5_rg2", (1, 1))
    assert how.env.objects.split == "train"
    assert how.noise_scale == (0.05, 0.15, 0.35)
    assert how.env.observation.expert_labels
    clean = _recording(RecordCfg(noise=False, objects="test"))
    assert (clean.noise_scale, clean.gripper_flip_probability) == ((), 0.0)
    assert clean.episode_steps == clean.env.episode_steps
    assert clean.env.objects.split == "test"


@pytest.mark.sim
def test_recording_goes_on_where_it_stopped(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["demos", "record", "--out", str(tmp_path / "new/demos.h5"), "--suite", "single", "--workers", "1"]
    assert cli.main([*command, "--episodes", "1"]) == 0
    assert cli.main([*command, "--episodes", "2"]) == 0
    assert "episodes  2, " in capsys.readouterr().out
    assert cli.main([*command, "--episodes", "3", "--robot", "ur5_rg2"]) == 2
    assert "was recorded with env.robot panda, not ur5_rg2; name another file" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("args", "sentence"),
    [
        (["recod"], "unknown action 'recod'; did you mean 'record'?"),
        (["info", "missing.h5"], "there are no demonstrations at 'missing.h5'"),
        (["record", "--robot", "pandda"], "did you mean 'panda'?"),
        (["record", "--objects", "nowhere"], "objects must be test, train, a folder"),
        (["record", "--episodes", "0"], "--episodes must be at least 1, got 0"),
    ],
)
def test_a_mistake_is_one_sentence(
    args: list[str], sentence: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.main(["demos", *args]) == 2
    error = capsys.readouterr().err
    assert sentence in error
    assert error.count("\n") == 1
