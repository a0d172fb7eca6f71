from dataclasses import replace

import pytest

from tr_grasp.configs import TrainCfg
from tr_grasp.errors import ConfigError
from tr_grasp.evaluation.players import load_player, with_robot


def test_a_player_that_never_learned_plays_with_any_robot():
    player = load_player("scripted")
    assert with_robot(player, "ur5_rg2").env == replace(player.env, robot="ur5_rg2")
    assert with_robot(player, None).env == player.env


def test_a_player_that_learned_keeps_its_robot():
    player = replace(load_player("zero"), name="mine", training=TrainCfg())
    assert with_robot(player, "panda").env == player.env
    with pytest.raises(ConfigError, match="'mine' learned on panda and plays only there"):
        with_robot(player, "ur5_rg2")


def test_an_unknown_robot_is_one_sentence():
    with pytest.raises(ConfigError, match="unknown robot 'ur5_rg3'; did you mean 'ur5_rg2'"):
        with_robot(load_player("random"), "ur5_rg3")
