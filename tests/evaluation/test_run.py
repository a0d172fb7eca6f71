from __future__ import annotations

import json
from pathlib import Path

import pytest
from PIL import Image

from tests.evaluation.fake_task import FakeEnv, make_fake_env
from tests.evaluation.test_report import SOURCE
from tests.evaluation.test_rollouts import suites_for
from tr_grasp.configs import EnvCfg
from tr_grasp.errors import StorageError
from tr_grasp.evaluation.players import load_player
from tr_grasp.evaluation.records import EpisodeRecord, read_episodes
from tr_grasp.evaluation.run import Finished, evaluate


def evaluated(out: Path, which: str = "all", **options: object) -> Finished | None:
    suites = suites_for("scripted", episodes=4, which=which)
    return evaluate(load_player("scripted"), suites, out, SOURCE, make_env=make_fake_env, **options)


class Interrupt:
    """Ctrl-C after some episodes."""

    def __init__(self, after: int) -> None:
        self.left = after

    def __call__(self, record: EpisodeRecord) -> None:
        self.left -= 1
        if self.left == 0:
            raise KeyboardInterrupt


def test_an_evaluation_leaves_table_summary_report_and_films(tmp_path: Path) -> None:
    finished = evaluated(tmp_path / "new", replays_per_suite=2)
    assert finished is not None
    assert not finished.was_interrupted
    records = read_episodes(tmp_path / "new")
    assert records == finished.evaluation.records
    assert [(r.suite, r.episode) for r in records] == [
        (s, i) for s in ("single", "scattered", "pile") for i in range(4)
    ]
    assert json.loads((tmp_path / "new" / "summary.json").read_text())["episodes_finished"] == 12
    assert len(finished.replays) == 6
    assert all(Image.open(path).format == "GIF" for path in finished.replays)
    html = finished.report.read_text()
    assert html.count("data:image/gif") == 6
    assert "ended otherwise" not in html


def test_ctrl_c_keeps_and_reports_what_was_done(tmp_path: Path) -> None:
    finished = evaluated(tmp_path, on_episode=Interrupt(after=5))
    assert finished is not None
    assert finished.was_interrupted
    assert len(read_episodes(tmp_path)) == 5
    assert "Stopped early: 12 episodes were asked for" in finished.report.read_text()
    assert finished.replays == ()


def test_ctrl_c_before_the_first_episode_leaves_nothing_to_report(tmp_path: Path) -> None:
    def impatient(cfg: EnvCfg) -> FakeEnv:
        raise KeyboardInterrupt

    suites = suites_for("scripted")
    assert evaluate(load_player("scripted"), suites, tmp_path, SOURCE, make_env=impatient) is None
    assert not (tmp_path / "report.html").exists()


def test_films_of_an_earlier_evaluation_are_replaced(tmp_path: Path) -> None:
    evaluated(tmp_path, "single", replays_per_suite=2)
    finished = evaluated(tmp_path, "single", replays_per_suite=1)
    assert finished is not None
    assert sorted((tmp_path / "replays").iterdir()) == sorted(finished.replays)
    assert len(finished.replays) == 1


def test_a_place_that_cannot_be_written_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(StorageError, match=r"cannot write .*file/episodes\.csv"):
        evaluated(tmp_path / "file")
