from __future__ import annotations

import pytest

from tr_grasp.cli import main, train


@pytest.fixture
def started(monkeypatch):
    """What would have been trained."""
    calls = []

    def record(cfg, folder, *, resume):
        calls.append((cfg, folder, resume))
        return 0

    monkeypatch.setattr(train, "_train", record)
    return calls


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_a_preset_and_flags_make_the_settings(started):
    assert main(["train", "thesis", "--seed", "3", "--algorithm.gamma", "0.9"]) == 0
    ((cfg, folder, resume),) = started
    assert (cfg.seed, cfg.algorithm.gamma, cfg.replay.capacity) == (3, 0.9, 40_000)
    assert (str(folder), resume) == ("runs/thesis-3", False)


def test_the_folder_can_be_chosen_and_comes_before_or_after_the_flags(started):
    assert main(["train", "smoke", "--run-dir", "a", "--seed", "1"]) == 0
    assert main(["train", "smoke", "--seed", "1", "--run-dir=b"]) == 0
    assert [str(folder) for _, folder, _ in started] == ["a", "b"]


def test_a_file_of_settings_works_like_a_preset(started, tmp_path):
    (tmp_path / "mine.yaml").write_text("extends: smoke\nseed: 5\n")
    assert main(["train", "mine.yaml"]) == 0
    assert str(started[0][1]) == "runs/mine-5"


def test_resuming_takes_the_settings_of_the_run_and_flags_on_top(started, tmp_path):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "config.yaml").write_text("seed: 7\n")
    assert main(["train", "--resume", "run", "--trainer.env-steps", "99"]) == 0
    cfg, folder, resume = started[0]
    assert (cfg.seed, cfg.trainer.env_steps, str(folder), resume) == (7, 99, "run", True)


@pytest.mark.parametrize(
    ("args", "sentence"),
    [
        ([], "give a preset"),
        (["smoke", "--resume", "run"], "give a preset"),
        (["smokey"], "unknown preset 'smokey'; did you mean 'smoke'?"),
        (["smoke", "--algoritm.gamma", "0.9"], "did you mean --algorithm.gamma"),
        (["smoke", "--algorithm.gamma", "2"], "algorithm.gamma must be in (0, 1), got 2.0"),
        (["smoke", "--run-dir"], "--run-dir needs a folder"),
        (["--resume", "nowhere"], "'nowhere' is not the folder of a run"),
        (["--resume", "run", "--run-dir", "b"], "leave out --run-dir"),
        (["smoke", "--run-dir", "full"], "'full' holds a run already; go on with --resume full"),
    ],
)
def test_mistakes_get_one_sentence(started, tmp_path, capsys, args, sentence):
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "checkpoint.pt").write_text("")
    assert main(["train", *args]) == 2
    errors = capsys.readouterr().err
    assert sentence in errors
    assert len(errors.strip().splitlines()) == 1
    assert not started


def test_help_lists_the_verbs_own_flags_and_the_settings(capsys):
    with pytest.raises(SystemExit) as stop:
        main(["train", "--help"])
    assert stop.value.code == 0
    text = capsys.readouterr().out
    for words in ("--resume RUN", "--run-dir DIR", "thesis", "--algorithm.gamma"):
        assert words in text


@pytest.mark.sim
def test_a_small_run_trains_saves_and_resumes(tmp_path, capsys):
    assert main(["train", "smoke", "--run-dir", "run"]) == 0
    assert "tr-grasp evaluate run/best" in capsys.readouterr().out
    assert main(["train", "--resume", "run", "--trainer.env-steps", "80"]) == 0
    output = capsys.readouterr().out
    assert "resumed at 60 environment steps" in output
    assert "80/80 steps" in output
