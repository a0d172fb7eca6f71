from __future__ import annotations

import pytest

from tr_grasp.cli import main


@pytest.mark.sim
def test_a_dry_run_plans_all_stages_and_moves_nothing(capsys):
    assert main(["pick-place", "--dry-run", "True"]) == 0
    out = capsys.readouterr().out
    for stage in ("pre-grasp", "grasp", "post-grasp", "place", "post-place", "home"):
        assert stage in out


@pytest.mark.parametrize(
    ("args", "sentence"),
    [
        (["--station", "thesys"], "thesis"),
        (["--trials", "0"], "--trials must be 1 or more"),
        (["--trials", "2", "--dry-run", "True"], "--trials counts simulated ones"),
        (["--arm", "ur5", "--strip", "x.png"], "--strip and --view draw a simulation"),
        (["--find", "luck"], "--find"),
        (["--grasp", "top_down"], "--grasp top_down needs --find camera"),
        (["--find", "camera", "--grasp-set", "x"], "--grasp-set is for --grasp grasp_set"),
    ],
)
def test_a_mistake_is_one_sentence(args, sentence, capsys):
    assert main(["pick-place", *args]) == 2
    error = capsys.readouterr().err
    assert sentence in error
    assert error.count("\n") == 1
