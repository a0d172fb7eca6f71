"""The verb ``dynamic``: settings, and one real evaluation and film."""

import json

import pytest

from tr_grasp.cli import dynamic, main
from tr_grasp.configs.dynamic import DynamicCfg
from tr_grasp.errors import ConfigError


def test_methods_and_conditions_stand_for_settings_that_flags_change():
    cfg = dynamic.read(dynamic.EvaluateCfg, ["--method", "thesis", "--conditions", "thesis", "--retry", "True"])
    assert (cfg.grasper.planner, cfg.grasper.limits, cfg.grasper.retry) == ("thesis", "thesis", True)
    assert (cfg.world.charges.mode, cfg.world.tracking.rate_hz, cfg.world.target_mass_kg) == ("fixed", 5.0, 1.0)
    ours = dynamic.read(dynamic.EvaluateCfg, ["--noise-m", "0.002", "--speed", "0.01", "0.05"])
    assert ours.grasper.planner == "intercept"
    assert ours.world.tracking.noise_m == 0.002
    assert ours.speed == (0.01, 0.05)
    assert dynamic.read(dynamic.EvaluateCfg, []).world == DynamicCfg()


def test_groups_of_motions_are_spelt_out_once_each():
    groups = {"thesis": ("a", "b"), "all": ("a", "b", "c")}
    assert dynamic.chosen("motion", ("b", "thesis"), groups) == ("b", "a")
    with pytest.raises(ConfigError, match="unknown motion 'd'"):
        dynamic.chosen("motion", ("d",), groups)
    with pytest.raises(ConfigError, match="at least one"):
        dynamic.chosen("motion", (), groups)


@pytest.mark.parametrize(
    "args",
    [
        ["evaluate", "--trials", "0"],
        ["evaluate", "--speed", "-1"],
        ["evaluate", "--motions", "zigzag"],
        ["evaluate", "--method", "both", "--label", "x"],
        ["play", "--view", "film.avi"],
        ["fly"],
    ],
)
def test_a_mistake_is_one_sentence(args, capsys):
    assert main(["dynamic", *args]) == 2
    assert capsys.readouterr().err.startswith("tr-grasp: ")


@pytest.mark.sim
def test_an_evaluation_of_two_trials_leaves_table_report_and_film_and_is_not_run_twice(tmp_path, capsys):
    args = ["evaluate", "--motions", "linear", "--objects", "010_potted_meat_can", "--trials", "2", "--workers", "1"]
    args += ["--replays", "1", "--mode", "free", "--out", str(tmp_path)]
    assert main(["dynamic", *args]) == 0
    printed = capsys.readouterr().out
    assert "table 5.11" in printed
    assert "thesis, Kalman filter" in printed
    rows = (tmp_path / "trials.csv").read_text()
    assert len(list((tmp_path / "replays").glob("*.gif"))) == 1
    assert "data:image/gif" in (tmp_path / "report.html").read_text()
    assert json.loads((tmp_path / "summary.json").read_text())["cells"][0]["trials"] == "2"
    args[args.index("--replays") + 1] = "0"
    assert main(["dynamic", *args]) == 0
    assert (tmp_path / "trials.csv").read_text() == rows


@pytest.mark.sim
def test_one_trial_is_filmed(tmp_path, capsys):
    view = tmp_path / "trial.png"
    args = ["play", "--motion", "circular", "--mode", "free", "--size", "96", "--view", str(view)]
    assert main(["dynamic", *args]) == 0
    assert view.stat().st_size > 1000
    assert "film" in capsys.readouterr().out
