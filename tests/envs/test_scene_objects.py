"""Which objects a scene of Task I has."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tr_grasp.configs import EnvCfg, ObjectsCfg
from tr_grasp.envs.scene_objects import draw_models
from tr_grasp.errors import ConfigError
from tr_grasp.evaluation.suites import named_suites
from tr_grasp.objects import object_set
from tr_grasp.objects.families import WIDE

SCENES_N = 400


def test_the_asked_share_of_scenes_holds_one_wide_object_alone() -> None:
    cfg = ObjectsCfg(source="procedural_wide", count_range=(2, 4), lone_wide_share=0.25)
    scenes = [draw_models(cfg, np.random.default_rng(seed)) for seed in range(SCENES_N)]
    lone = [scene for scene in scenes if len(scene) == 1]
    assert all(scene[0].family in WIDE for scene in lone)
    spread_n = np.sqrt(SCENES_N * 0.25 * 0.75)
    assert abs(len(lone) - 0.25 * SCENES_N) < 4 * spread_n
    assert {len(scene) for scene in scenes} == {1, 2, 3, 4}


def test_without_such_scenes_nothing_is_drawn_for_them() -> None:
    cfg = ObjectsCfg(source="procedural", count_range=(2, 2))
    drawn, expected = np.random.default_rng(3), np.random.default_rng(3)
    draw_models(cfg, drawn)
    chosen = object_set("procedural", "train")
    expected.integers(2, 3)
    for _ in range(2):
        chosen.sample(expected)
    assert drawn.random() == expected.random()


def test_as_many_objects_as_may_be_where_their_number_is_not_drawn() -> None:
    cfg = ObjectsCfg(count_range=(1, 3))
    assert {len(draw_models(cfg, np.random.default_rng(seed), count_is_drawn=False)) for seed in range(9)} == {3}


def test_only_the_wide_set_has_wide_objects() -> None:
    with pytest.raises(ConfigError, match=r"choose objects\.source procedural_wide or objects\.lone_wide_share 0"):
        ObjectsCfg(source="procedural", lone_wide_share=0.5)
    with pytest.raises(ConfigError, match=r"must be in \[0, 1\], got 1.5"):
        ObjectsCfg(source="procedural_wide", lone_wide_share=1.5)


@pytest.mark.parametrize("objects", ["test", "train", "procedural_wide"])
def test_suites_have_no_scenes_that_training_mixed_in(objects: str) -> None:
    trained_in = EnvCfg(objects=replace(ObjectsCfg(), source="procedural_wide", lone_wide_share=0.5))
    suites = named_suites("all", trained_in, objects=objects, episodes=1, first_seed=0)
    assert {suite.env.objects.lone_wide_share for suite in suites} == {0.0}
