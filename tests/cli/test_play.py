"""``tr-grasp play`` on the real task."""

from __future__ import annotations

from pathlib import Path

import pytest
from PIL import Image

import tr_grasp.cli as cli


@pytest.mark.sim
def test_every_episode_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["play", "--episodes", "2", "--suite", "single", "--seed", "5"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split("  ")[:2] for line in lines] == [["episode 0", "seed 5"], ["episode 1", "seed 6"]]


@pytest.mark.sim
def test_steps_can_be_printed_and_filmed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    film = tmp_path / "new" / "film.gif"
    args = ["play", "--episodes", "1", "--suite", "single", "--each-step", "True", "--view", str(film)]
    assert cli.main(args) == 0
    *steps, episode, last = capsys.readouterr().out.splitlines()
    assert steps[0].startswith("  step 0    start   tcp (")
    assert steps[-1].split()[-4:] == ["reach", "touch", "grasp", "lift"]
    assert f"steps {len(steps) - 1}" in episode
    assert last == f"film  {film}"
    assert Image.open(film).n_frames == len(steps)


@pytest.mark.parametrize(
    ("args", "sentence"),
    [
        (["--view", "film.avi"], "view must end in .gif, .mp4, .png, got 'film.avi'"),
        (["--view", "film.gif", "--episodes", "11"], "--view films at most 10 episodes, got --episodes 11"),
        (["--agent", "rnadom"], "unknown policy 'rnadom'; did you mean 'random'?"),
        (["--suite", "all"], "--suite: must be one of 'single', 'scattered', 'pile', got 'all'"),
        (["--episodes", "0"], "episodes must be at least 1, got 0"),
    ],
)
def test_a_mistake_is_one_sentence(args: list[str], sentence: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["play", *args]) == 2
    error = capsys.readouterr().err
    assert sentence in error
    assert error.count("\n") == 1
