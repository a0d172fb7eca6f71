"""Settings on the command line."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import pytest
import tyro
from hypothesis import given, settings

from tests.configs.strategies import changes, delta_of
from tr_grasp.configs import TrainCfg
from tr_grasp.configs.build import build, leaf_types
from tr_grasp.configs.flags import ALIASES, _lengthen, parse
from tr_grasp.errors import ConfigError


@dataclass(frozen=True)
class JudgeArgs:
    """Judge a policy."""

    policy: tyro.conf.Positional[str]
    """Folder or name."""
    episodes: int = 200
    """How many."""
    objects: Literal["train", "test"] = "test"
    """Which."""
    limit_s: float | None = None
    """For how long."""


def words(path: str, value: Any) -> list[str]:
    return [f"--{path}", *(map(str, value) if isinstance(value, list) else [str(value)])]


@settings(max_examples=30)
@given(named=changes())
def test_a_flag_says_the_same_as_a_line_in_a_file(named: list[tuple[str, Any]]) -> None:
    expected = TrainCfg()
    args: list[str] = []
    for path, value in named:
        if isinstance(value, str) and value.startswith("-"):
            continue  # looks like a flag, here as in every other program
        expected = build(expected, delta_of(path, value))
        args += words(path, value)
    assert parse(TrainCfg, args, TrainCfg()) == expected


@pytest.mark.parametrize(
    "flag",
    [
        "--replay.symmetry-augmentation false",
        "--replay.symmetry_augmentation False",
        "--replay.symmetry-augmentation=False",
    ],
)
def test_hyphens_and_underscores_are_the_same(flag: str) -> None:
    assert parse(TrainCfg, flag.split(), TrainCfg()).replay.symmetry_augmentation is False


@pytest.mark.parametrize(
    ("short", "path"),
    [
        ("--encoder residual_ocnn", "network.encoder"),
        ("--num-blocks 4", "network.num_blocks"),
        ("--norm batch", "network.norm"),
        ("--heads advanced", "network.heads"),
        ("--features_n=32", "network.features_n"),
        ("--algorithm sac", "algorithm.name"),
        ("--drop-per-net 3", "algorithm.drop_per_net"),
        ("--drop-per-net None", "algorithm.drop_per_net"),
        ("--encoder-grad actor", "algorithm.encoder_grad"),
        ("--stack 2", "env.observation.stack_n"),
        ("--stack-n 2", "env.observation.stack_n"),
        ("--colour off", "env.observation.colour"),
        ("--seed 3", "seed"),
    ],
)
def test_the_last_part_of_a_path_is_enough(short: str, path: str) -> None:
    name, *values = short.replace("=", " ").split()
    assert parse(TrainCfg, short.split(), TrainCfg()) == parse(TrainCfg, [f"--{path}", *values], TrainCfg())
    assert name.startswith("--")


def test_spectral_norm_is_one_flag_beside_the_heads_that_it_needs() -> None:
    network = parse(TrainCfg, ["--heads", "advanced", "--spectral-norm", "critic"], TrainCfg()).network
    assert (network.heads, network.spectral_norm) == ("advanced", "critic")


def test_every_setting_has_the_short_flag_that_is_its_own_and_no_other() -> None:
    paths = [path for path, _ in leaf_types(TrainCfg)]
    for path in paths:
        last = path.rpartition(".")[2]
        alike = [other for other in paths if other.rpartition(".")[2] == last]
        meant = _lengthen(dict(leaf_types(TrainCfg)), f"--{last}") if len(alike) == 1 else None
        assert meant in (None, f"--{path}")


def test_a_short_flag_that_could_be_several_is_refused_with_all_of_them() -> None:
    with pytest.raises(ConfigError) as refused:
        parse(TrainCfg, ["--episode-steps", "9"], TrainCfg())
    assert str(refused.value) == (
        "--episode-steps: could be --env.episode_steps or --demonstrations.episode_steps or --trainer.episode_steps; "
        "write one of them out"
    )


def test_aliases_are_settings() -> None:
    assert set(ALIASES.values()) <= {path for path, _ in leaf_types(TrainCfg)}


def test_help_says_in_one_sentence_that_flags_may_be_short(capsys: pytest.CaptureFixture[str]) -> None:
    for cfg_class, told in ((TrainCfg, True), (JudgeArgs, False)):
        with pytest.raises(SystemExit):
            parse(cfg_class, ["--help"], prog="judge")
        assert ("A flag may be as short as" in " ".join(capsys.readouterr().out.split())) == told


def test_flags_change_the_default_that_is_given() -> None:
    default = TrainCfg(seed=4)
    assert parse(TrainCfg, [], default) == default
    assert parse(TrainCfg, ["--algorithm.gamma", "0.9"], default).seed == 4


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("--env.observation.dpeth 4", "--env.observation.dpeth: unknown; did you mean --env.observation.depth?"),
        ("--objects.split test", "--objects.split: unknown; did you mean --env.objects.split?"),
        ("--observation 3", "--observation: unknown; did you mean --env.observation.…?"),
        ("--qqqq 3", "--qqqq: unknown; see --help"),
        ("--env.observation.depth five", "--env.observation.depth: must be a whole number, got 'five'"),
        ("--env.observation.depth 9", "observation.depth must be 3..6, got 9"),
        (
            "--env.objects.split=tset",
            "--env.objects.split: must be one of 'train', 'test', got 'tset'; did you mean test?",
        ),
        ("--env.objects.count-range 1", "--env.objects.count-range: must be a list of 2 values, got 1: [1]"),
        ("--optimiser.learning-rate nan", "--optimiser.learning_rate: must be finite, got nan"),
        ("--replay.symmetry_augmentation maybe", "--replay.symmetry_augmentation: must be true or false, got 'maybe'"),
        ("--seed", "--seed: needs a value"),
        ("stray", "Unrecognized options: stray"),
    ],
)
def test_a_slip_on_the_command_line_gets_one_clear_sentence(line: str, message: str) -> None:
    with pytest.raises(ConfigError) as refused:
        parse(TrainCfg, line.split(), TrainCfg())
    assert str(refused.value) == message


def test_positional_arguments_work() -> None:
    args = parse(JudgeArgs, ["panda", "--episodes", "3", "--limit-s", "None"])
    assert args == JudgeArgs("panda", 3)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("", "Missing from judge: POLICY"),
        ("panda --epsodes 3", "--epsodes: unknown; did you mean --episodes?"),
        ("panda --zzzz 3", "--zzzz: unknown; valid: --policy, --episodes, --objects, --limit_s"),
        ("panda other", "Unrecognized options: other"),
        ("panda --limit-s long", "--limit-s: must be a finite number or nothing, got 'long'"),
    ],
)
def test_slips_beside_positional_arguments_are_explained_too(line: str, message: str) -> None:
    with pytest.raises(ConfigError) as refused:
        parse(JudgeArgs, line.split(), prog="judge")
    assert str(refused.value).startswith(message)
    assert "\n" not in str(refused.value)


def test_help_lists_the_flags_and_stops(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        parse(JudgeArgs, ["--help"], prog="judge")
    assert not stop.value.code
    assert "--limit-s" in (shown := capsys.readouterr().out)
    assert "For how long." in shown
