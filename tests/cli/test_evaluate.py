"""``tr-grasp evaluate`` and ``tr-grasp demo`` on the real task."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import tr_grasp.cli as cli
from tr_grasp.cli import demo, doctor
from tr_grasp.evaluation.records import read_episodes


@pytest.mark.sim
def test_an_evaluation_tells_its_result_and_where_it_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "scripted"
    args = ["evaluate", "scripted", "--suite", "single", "--episodes", "2", "--workers", "1", "--replays", "1"]
    assert cli.main([*args, "--out", str(out)]) == 0
    told = capsys.readouterr()
    records = read_episodes(out)
    assert [record.seed for record in records] == [20_000, 20_001]
    successes = sum(record.success for record in records)
    assert f"{50 * successes}.0 %" in told.out
    for name in ("episodes.csv", "report.html"):
        assert str(out / name) in told.out
        assert (out / name).is_file()
    assert f"success {50 * successes} %" in told.err
    summary = json.loads((out / "summary.json").read_text())
    assert summary["command"] == f"tr-grasp {' '.join(args)} --out {out}"
    assert cli.main([*args, "--out", str(out)]) == 2
    assert f"--out: {out} already holds an evaluation" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("args", "sentence"),
    [
        (["scripted", "--episode", "2"], "did you mean --episodes?"),
        (["scripted", "--suite", "heap"], "--suite: must be one of 'single', 'scattered', 'pile', 'all', got 'heap'"),
        (["scripted", "--episodes", "few"], "--episodes: must be a whole number, got 'few'"),
        (["scripted", "--episodes", "0"], "episodes must be at least 1, got 0"),
        (["scripted", "--workers", "0"], "--workers must be at least 1, got 0"),
        (["scripted", "--replays", "-1"], "--replays must not be negative, got -1"),
        (
            ["scripted", "--objects", "tset"],
            "objects must be test, train, a folder of meshes or the name of one; 'tset' is none",
        ),
        (["scirpted"], "unknown policy 'scirpted'; did you mean 'scripted'?"),
        ([], "POLICY"),
    ],
)
def test_a_mistake_is_one_sentence(args: list[str], sentence: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["evaluate", *args]) == 2
    error = capsys.readouterr().err
    assert sentence in error
    assert error.count("\n") == 1


@pytest.mark.parametrize("verb", ["evaluate", "compare", "play", "demo"])
def test_help_explains_every_flag(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        cli.main([verb, "--help"])
    assert stop.value.code == 0
    assert f"usage: tr-grasp {verb}" in capsys.readouterr().out


def test_the_demo_stops_where_the_machine_lacks_something(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "main", lambda args: 1)
    monkeypatch.setattr(demo, "run", lambda *args, **kwargs: pytest.fail("played"))
    assert cli.main(["demo"]) == 1


@pytest.mark.sim
def test_the_demo_shows_table_report_and_film(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(doctor, "main", lambda args: 0)
    args = ["demo", "--policy", "scripted", "--episodes", "1", "--workers", "1", "--replays", "1"]
    for _ in range(2):
        assert cli.main([*args, "--out", str(tmp_path)]) == 0
        out = capsys.readouterr().out
        assert "95 % interval" in out
        assert f"report    {tmp_path / 'report.html'}" in out
        assert f"replay    {tmp_path / 'replays'}" in out
