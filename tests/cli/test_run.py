from __future__ import annotations

import pytest

from tr_grasp.cli import main

pytestmark = pytest.mark.sim


@pytest.fixture(scope="module")
def logged(tmp_path_factory):
    """The log of the shipped policy's first two steps in a simulated scene."""
    folder = tmp_path_factory.mktemp("run")
    main(["run", "panda", "--steps", "2", "--seed", "20001", "--log", str(folder)])
    return folder / "panda_20001.npz"


def test_a_run_leaves_a_log_that_plays_again_with_the_same_actions(logged, capsys, tmp_path):
    assert logged.is_file()
    assert main(["run", "--replay", str(logged), "--view", str(tmp_path / "run.png")]) == 0
    assert (tmp_path / "run.png").read_bytes().startswith(b"\x89PNG")
    assert "2 steps" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("args", "sentence"),
    [
        (["pandaa"], "did you mean 'panda'"),
        (["panda", "--episodes", "0"], "--episodes and --steps must be 1 or more"),
        (["panda", "--view", "x.gif"], "--view films a log"),
        (["--replay", "nowhere.npz"], "nowhere.npz"),
        (["panda", "--arm", "ur5", "--episodes", "2"], "--episodes counts simulated runs"),
    ],
)
def test_a_mistake_is_one_sentence(args, sentence, capsys):
    assert main(["run", *args]) == 2
    error = capsys.readouterr().err
    assert sentence in error
    assert error.count("\n") == 1
