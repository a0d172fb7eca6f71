"""``tr-grasp compare``, from files to the sentence on the terminal."""

from __future__ import annotations

from pathlib import Path

import pytest

import tr_grasp.cli as cli
from tests.evaluation.test_comparison import episodes
from tr_grasp.evaluation.records import write_episodes


def written(folder: Path, successes: list[bool], first_seed: int = 0) -> Path:
    folder.mkdir()
    write_episodes(folder / "episodes.csv", episodes(successes, first_seed=first_seed))
    return folder


def test_two_folders_are_compared_in_a_table_and_a_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    a = written(tmp_path / "a", [True] * 9 + [False])
    b = written(tmp_path / "b", [False] * 9 + [True])
    assert cli.main(["compare", str(a), str(b / "episodes.csv")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[:2] == [f"A  {a}", f"B  {b / 'episodes.csv'}"]
    row = "single  90.0 % of 10  10.0 % of 10  +80.0 %  +24.5 to +100.0 %  0.021  McNemar, exact  0.00035"
    assert " ".join(lines[5].split()) == " ".join(row.split())
    assert lines[-1] == "single: The difference is significant at 5 % (p = 0.021): A is better."


def test_the_thesis_colour_ablation_is_not_significant(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """45.5 % against 40.5 % of 200 other episodes each."""
    a = written(tmp_path / "a", [i < 91 for i in range(200)])
    b = written(tmp_path / "b", [i < 81 for i in range(200)], first_seed=1000)
    assert cli.main(["compare", str(a), str(b)]) == 0
    out = capsys.readouterr().out
    assert "0.31" in out
    assert "not significant at 5 %" in out


def test_a_folder_without_an_evaluation_is_one_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["compare", str(tmp_path), str(tmp_path)]) == 2
    assert capsys.readouterr().err == (
        f"tr-grasp: {tmp_path}/episodes.csv does not exist; "
        "name the folder or the CSV file that `tr-grasp evaluate` wrote.\n"
    )


def test_comparing_needs_two(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["compare", "a"]) == 2
    assert "B" in capsys.readouterr().err
