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


def test_a_film_by_the_renderer_is_refused_without_a_vulkan_device(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("tr_grasp.cli.vulkan.probe_vulkan", lambda: ("", "no driver"))
    assert cli.main(["play", "--view", str(tmp_path / "film.png"), "--view-camera", "sapien"]) == 2
    assert "--view-camera sapien needs a Vulkan device (no driver)" in capsys.readouterr().err


@pytest.mark.sim
@pytest.mark.render
@pytest.mark.parametrize("ending", ["png", "mp4"])
def test_the_renderer_films_too(ending: str, tmp_path: Path) -> None:
    film = tmp_path / f"film.{ending}"
    args = ["--agent", "zero", "--suite", "single", "--episodes", "1", "--random-looks", "True", "--view", str(film)]
    assert cli.main(["play", *args, "--view-camera", "sapien"]) == 0
    assert film.stat().st_size > 10_000


@pytest.mark.sim
def test_the_browser_gets_every_episode_and_stays_until_ctrl_c(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("viser")
    monkeypatch.setattr("tr_grasp.evaluation.run.frame_s", lambda suite: 0.0)
    waited: list[bool] = []
    monkeypatch.setattr("tr_grasp.cli.play.wait_for_ctrl_c", lambda: waited.append(True))
    args = ["--suite", "single", "--episodes", "1", "--seed", "5", "--browser", "True", "--port", "18090"]
    assert cli.main(["play", *args]) == 0
    page, episode, _ = capsys.readouterr().out.splitlines()
    assert page.startswith("page  http://localhost:")
    assert episode.startswith("episode 0  seed 5")
    assert waited == [True]


@pytest.mark.parametrize(
    ("args", "sentence"),
    [
        (["--view", "film.avi"], "view must end in .gif, .mp4, .png, got 'film.avi'"),
        (["--view", "film.gif", "--episodes", "11"], "--view films at most 10 episodes, got --episodes 11"),
        (["--agent", "rnadom"], "unknown policy 'rnadom'; did you mean 'random'?"),
        (["--suite", "all"], "--suite: must be one of 'single', 'scattered', 'pile', got 'all'"),
        (["--browser", "True", "--view", "film.gif"], "--browser shows every step by itself; leave out --view"),
        (["--view", "film.gif", "--view-camera", "vulkan"], "must be one of 'raycast', 'sapien', got 'vulkan'"),
        (["--episodes", "0"], "episodes must be at least 1, got 0"),
    ],
)
def test_a_mistake_is_one_sentence(args: list[str], sentence: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["play", *args]) == 2
    error = capsys.readouterr().err
    assert sentence in error
    assert error.count("\n") == 1
