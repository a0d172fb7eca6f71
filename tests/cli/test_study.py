from __future__ import annotations

import json

import pytest

from tr_grasp.cli import main, study
from tr_grasp.evaluation.records import EpisodeRecord

STUDY = """
question: Does a larger batch help?
runs:
  small batch: {extends: smoke}
  large batch: {extends: smoke, replay: {batch_size: 128}}
"""


def records(successes: list[bool]) -> list[EpisodeRecord]:
    end = {True: "lifted", False: "never reached an object"}
    return [
        EpisodeRecord("scattered", i, 20_000 + i, won, end[won], 10, 1.0, 1, ("a",), ("a",), won, won, won, won, 0.1)
        for i, won in enumerate(successes)
    ]


@pytest.fixture
def trained(tmp_path, monkeypatch):
    """Runs of a study that were started; training and judging are played."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.yaml").write_text(STUDY)
    runs = []

    def train(cfg, folder, command):
        runs.append((cfg, folder))
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "progress.csv").write_text("env_steps,evaluation/success\n500,0.25\n600,\n1000,0.75\n")
        return True

    monkeypatch.setattr(study, "_train", train)
    monkeypatch.setattr(study, "_judge", lambda folder, *_: records([True] * 9 + ["large" in folder.name]))
    return runs


def test_every_run_is_trained_with_every_seed_and_the_settings_given(trained, capsys):
    assert main(["study", "mine.yaml", "--seeds", "2", "--trainer.env-steps", "77"]) == 0
    assert [(cfg.replay.batch_size, cfg.seed, folder.name) for cfg, folder in trained] == [
        (trained[0][0].replay.batch_size, 0, "small_batch-0"),
        (128, 0, "large_batch-0"),
        (trained[0][0].replay.batch_size, 1, "small_batch-1"),
        (128, 1, "large_batch-1"),
    ]
    assert {cfg.trainer.env_steps for cfg, _ in trained} == {77}
    out = capsys.readouterr().out
    assert "Does a larger batch help?" in out
    # Worked by hand: 18 of 20 against 20 of 20, in pairs of which two differ, so p = 2 * (1/2)^2.
    small, large = (line for line in out.splitlines() if line.startswith(("small batch ", "large batch ")))
    assert small.split()[2:4] == ["90.0", "%"]
    assert small.endswith("90, 90")
    assert large.split()[2:4] == ["100.0", "%"]
    assert large.split()[-5:] == ["+10.0", "%", "0.5", "McNemar,", "exact"]


def test_a_study_leaves_its_table_and_its_curves(trained, tmp_path):
    assert main(["study", "mine.yaml", "--out", "here"]) == 0
    assert json.loads((tmp_path / "here/summary.json").read_text()) == {
        "small batch": {"0": 0.9},
        "large batch": {"0": 1.0},
    }
    assert (tmp_path / "here/curves.png").read_bytes().startswith(b"\x89PNG")


def test_ctrl_c_says_how_to_go_on(trained, monkeypatch, capsys):
    monkeypatch.setattr(study, "_train", lambda *_: False)
    assert main(["study", "mine.yaml"]) == 130
    assert "go on with: tr-grasp study mine.yaml --out runs/studies/mine" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("args", "sentence"),
    [
        ([], "give a study (c1_colour,"),
        (["c1_color"], "did you mean 'c1_colour'"),
        (["mine.yaml", "--seeds", "none"], "--seeds must be a whole number of at least 1, got none"),
        (["mine.yaml", "--episodes"], "--episodes needs a number"),
        (["mine.yaml", "--seedz", "2"], "--seedz: unknown"),
    ],
)
def test_a_mistake_is_one_sentence(trained, capsys, args, sentence):
    assert main(["study", *args]) == 2
    assert sentence in capsys.readouterr().err
    assert trained == []


def test_what_is_finished_is_not_repeated(tmp_path, capsys):
    from tr_grasp.configs.io import load_train_cfg

    cfg = load_train_cfg("smoke")
    (tmp_path / "training.json").write_text(json.dumps({"env_steps": cfg.trainer.env_steps}))
    assert study._train(cfg, tmp_path, "tr-grasp study mine.yaml")
    assert "trained already" in capsys.readouterr().out
