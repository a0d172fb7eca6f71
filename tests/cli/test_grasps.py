"""``tr-grasp grasps``."""

from __future__ import annotations

import numpy as np
import pytest

import tr_grasp.cli as cli
from tr_grasp.grasps import GraspSet

SMALL = [
    "--build.candidates-n", "400", "--build.screen-n", "8", "--build.finalists-n", "3", "--build.tries", "2",
    "--build.keep-from", "0", "--build.trial.parallel-n", "4", "--build.screen-tries", "1",
]  # fmt: skip


@pytest.mark.sim
def test_a_set_is_built_shown_and_tried_again(tmp_path, capsys):
    out = tmp_path / "new" / "sugar.grasps.safetensors"
    assert cli.main(["grasps", "build", "004_sugar_box", "--out", str(out), *SMALL]) == 0
    assert [path.name for path in out.parent.iterdir() if path.name.startswith(".")] == []
    assert out.with_suffix(".png").stat().st_size > 10_000
    assert len(GraspSet.load(out)) >= 1
    capsys.readouterr()
    assert cli.main(["grasps", "build", "004_sugar_box", "--out", str(out), *SMALL]) == 2
    assert "is there already" in capsys.readouterr().err
    assert cli.main(["grasps", "show", str(out), "--top", "1"]) == 0
    assert capsys.readouterr().out.startswith("004_sugar_box by robotiq_2f85: ")
    assert cli.main(["grasps", "replay", str(out), "--top", "2", "--tries", "1"]) == 0
    best, chance = capsys.readouterr().out.splitlines()
    assert best.startswith("best 2")
    assert chance.startswith("random 2")


def test_the_grasps_of_task_two_are_known_by_name(tmp_path, capsys):
    picture = tmp_path / "sheet.png"
    assert cli.main(["grasps", "show", "010_potted_meat_can", "--top", "3", "--picture", str(picture)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[-1] == f"picture  {picture}"
    assert lines[4].split()[0] == "1"
    assert np.frombuffer(picture.read_bytes()[:4], np.uint8).tolist() == [0x89, 0x50, 0x4E, 0x47]


@pytest.mark.parametrize(
    ("args", "sentence"),
    [
        (["bild"], "unknown verb of grasps 'bild'; did you mean 'build'?"),
        (["build", "004_sugar_box", "--gripper", "rg3"], "unknown gripper 'rg3'; did you mean 'rg2'?"),
        (["build", "nothing.obj"], "It may also be the path of a mesh file"),
        (["build", "004_sugar_box", "--scale", "-1"], "scale must be positive and finite, got -1.0"),
        (["build", "004_sugar_box", "--build.tries", "0"], "tries must be at least 1, got 0"),
        (["show", "nothing"], "there is no grasp set at 'nothing'"),
        (["show", "004_sugar_box", "--top", "0"], "--top must be at least 1, got 0"),
    ],
)
def test_a_mistake_is_one_sentence(args, sentence, capsys):
    assert cli.main(["grasps", *args]) == 2
    assert sentence in capsys.readouterr().err


def test_help_says_what_there_is(capsys):
    assert cli.main(["grasps"]) == 0
    assert "replay FILE" in capsys.readouterr().out


@pytest.mark.sim
def test_an_object_that_is_too_wide_is_refused_before_it_is_tried(tmp_path, capsys):
    args = ["grasps", "build", "010_potted_meat_can", "--scale", "2", "--out", str(tmp_path / "a")]
    assert cli.main(args) == 2
    assert "and gripper 'robotiq_2f85' opens 85 mm" in capsys.readouterr().err
