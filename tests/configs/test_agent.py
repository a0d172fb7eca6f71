"""Settings of networks and algorithms that fit each other, and those that are refused."""

from __future__ import annotations

import pytest

from tr_grasp.configs import TrainCfg
from tr_grasp.configs.flags import parse
from tr_grasp.configs.io import load_train_cfg, preset_names
from tr_grasp.errors import ConfigError


def refusal(line: str, preset: str | None = None) -> str:
    with pytest.raises(ConfigError) as refused:
        parse(TrainCfg, line.split(), load_train_cfg(preset) if preset else TrainCfg())
    return str(refused.value)


@pytest.mark.parametrize("name", ["tqc", "sac", "td3", "ddpg"])
@pytest.mark.parametrize("preset", [n for n in preset_names() if not n.startswith(("thesis", "experiment"))])
def test_every_algorithm_is_one_flag_on_top_of_our_presets(preset: str, name: str) -> None:
    cfg = parse(TrainCfg, ["--algorithm", name], load_train_cfg(preset)).algorithm
    assert cfg.name == name
    assert cfg.critic_count == (1 if name == "ddpg" else 2)
    assert cfg.critic_outputs == (cfg.quantiles_n if name == "tqc" else 1)
    assert cfg.actor_period == (2 if name == "td3" else 1)
    assert cfg.action_noise > 0 or cfg.is_stochastic


def test_what_is_given_replaces_what_the_algorithm_chooses() -> None:
    line = "--algorithm td3 --critics-n 3 --actor-every-n 4 --action-noise 0.3"
    cfg = parse(TrainCfg, line.split(), TrainCfg()).algorithm
    assert (cfg.critic_count, cfg.actor_period, cfg.action_noise) == (3, 4, 0.3)
    assert parse(TrainCfg, ["--drop-per-net", "0"], TrainCfg()).algorithm.dropped_quantiles == 0


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("--algorithm sac --drop-per-net 3", ["drop_per_net", "sac", "choose algorithm.drop_per_net None or"]),
        ("--algorithm ddpg --critics-n 2", ["critics_n is 2", "ddpg", "choose algorithm.critics_n 1"]),
        ("--algorithm td3 --action-noise 0", ["action_noise is 0", "td3", "choose a positive one"]),
        ("--spectral-norm critic", ["spectral_norm critic", "heads vanilla", "choose network.heads dense_residual"]),
        ("--heads dueling --spectral-norm all", ["spectral_norm all", "heads dueling", "network.spectral_norm none"]),
        ("--quantiles-n 5 --drop-per-net 5", ["drop_per_net must be 0..4, got 5"]),
        ("--critics-n 0", ["critics_n must be at least 1"]),
        ("--output-scale 0", ["output_scale must be positive"]),
        ("--num-blocks 0", ["num_blocks must be at least 1"]),
    ],
)
def test_settings_that_do_not_fit_are_refused_with_a_way_out(line: str, words: list[str]) -> None:
    message = refusal(line)
    assert all(word in message for word in words), message


def test_the_thesis_preset_says_which_of_its_settings_belong_to_tqc() -> None:
    assert "drop_per_net" in refusal("--algorithm sac", "thesis")
    cfg = parse(TrainCfg, ["--algorithm", "sac", "--drop-per-net", "None"], load_train_cfg("thesis"))
    assert cfg.algorithm.name == "sac"
