from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from tr_grasp.configs import CameraCfg, EnvCfg
from tr_grasp.errors import ConfigError
from tr_grasp.evaluation.suites import ARRANGEMENTS, Suite, named_suites

OWN = EnvCfg(control_hz=2.5, fresh_scene_every_n=4, camera=CameraCfg(image_size_px=64))


@pytest.mark.parametrize("name", ARRANGEMENTS)
def test_a_suite_changes_the_objects_and_nothing_else_of_a_policys_world(name: str) -> None:
    (suite,) = named_suites(name, OWN, objects="test", episodes=5, first_seed=7)
    assert suite.env.fresh_scene_every_n == 1
    assert suite.env.objects.split == "test"
    assert replace(suite.env, objects=OWN.objects, fresh_scene_every_n=4) == OWN


def test_the_three_suites_by_hand() -> None:
    suites = named_suites("all", OWN, objects="train", episodes=5, first_seed=7)
    seen = [(s.name, s.env.objects.count_range, s.env.objects.arrangement) for s in suites]
    assert seen == [("single", (1, 1), "scattered"), ("scattered", (2, 4), "scattered"), ("pile", (4, 4), "pile")]
    assert {s.env.objects.source for s in suites} == {"procedural"}
    assert [suites[0].seed(i) for i in range(3)] == [7, 8, 9]


def test_a_folder_is_a_source_of_objects(tmp_path: Path) -> None:
    (suite,) = named_suites("pile", OWN, objects=str(tmp_path), episodes=1, first_seed=0)
    assert suite.env.objects.source == str(tmp_path)


def test_an_unknown_suite_or_folder_is_one_sentence() -> None:
    with pytest.raises(ConfigError, match="unknown suite 'piles'; did you mean 'pile'"):
        named_suites("piles", OWN, objects="test", episodes=1, first_seed=0)
    with pytest.raises(ConfigError, match="a folder of meshes or the name of one; 'tset' is none"):
        named_suites("pile", OWN, objects="tset", episodes=1, first_seed=0)


def test_a_suite_needs_an_episode_and_a_seed() -> None:
    with pytest.raises(ConfigError, match="episodes must be at least 1, got 0"):
        Suite("single", OWN, 0, 1)
    with pytest.raises(ConfigError, match="seed must not be negative, got -1"):
        Suite("single", OWN, 1, -1)
