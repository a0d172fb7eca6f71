from __future__ import annotations

import json

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


@pytest.mark.sim
def test_trials_that_are_on_file_are_not_run_again_and_others_are_not_mixed_with_them(tmp_path, capsys):
    trial = {"shift_m": [0.004, -0.002], "yaw_rad": 1.0, "outcome": "DONE", "reason": "all stages were carried out"}
    trial |= {"placed": True, "upright": True, "touches_n": 0, "force_n": 0.0, "cycle_s": 20.0, "retries_n": 0}
    what = {"station": "thesis", "grasp": "blind", "largest_shift_m": 0.01, "retries": 2}
    rows = tmp_path / "rows.jsonl"
    rows.write_text("".join(json.dumps(what | trial | {"seed": seed}) + "\n" for seed in (0, 1)))
    args = ["pick-place", "--trials", "2", "--out", str(rows)]
    assert main([*args, "--shift-m", "0.01"]) == 0
    assert "2 of 2 placed" in capsys.readouterr().out
    assert main([*args, "--shift-m", "0.02"]) == 2
    assert "trials with other settings" in capsys.readouterr().err
    rows.write_text("nothing")
    assert main([*args, "--shift-m", "0.01"]) == 2
    assert "holds no trials of pick and place" in capsys.readouterr().err
