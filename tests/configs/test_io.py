"""Settings in files: what is written is what is read, and every slip has its sentence."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.configs.strategies import train_cfgs
from tr_grasp.configs import TrainCfg
from tr_grasp.configs.io import dump_yaml, load_cfg, load_train_cfg, preset_names
from tr_grasp.errors import ConfigError


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("settings")


def written(folder: Path, text: str, name: str = "x.yaml") -> Path:
    (folder / name).write_text(text, encoding="utf-8")
    return folder / name


def message_of(path: Path) -> str:
    with pytest.raises(ConfigError) as refused:
        load_train_cfg(path)
    return str(refused.value).replace(f"{path.parent}/", "")


@given(cfg=train_cfgs())
def test_what_is_dumped_is_loaded_again(folder: Path, cfg: TrainCfg) -> None:
    assert load_train_cfg(written(folder, dump_yaml(cfg))) == cfg


@dataclass(frozen=True)
class NoteCfg:
    text: str = ""
    number: float = 0.0


@given(text=st.text(st.characters(codec="utf-8")), number=st.floats(allow_nan=False, allow_infinity=False))
def test_any_text_and_any_number_survive(folder: Path, text: str, number: float) -> None:
    cfg = NoteCfg(text, number)
    assert load_cfg(NoteCfg(), written(folder, dump_yaml(cfg))) == cfg


@pytest.mark.parametrize(
    "text", ["\x85", "é", "3e-4", "1e6", "yes", "null", "1_000", "~", "- a", "a: b", "#", "", " x ", "2024-01-01"]
)
def test_text_that_looks_like_something_else_stays_text(folder: Path, text: str) -> None:
    assert load_cfg(NoteCfg(), written(folder, dump_yaml(NoteCfg(text)))).text == text


@pytest.mark.parametrize(
    ("written_as", "meant"),
    [("3e-4", 3e-4), ("3.0e-4", 3e-4), ("1e6", 1e6), ("2.E+1", 20.0), (".5e0", 0.5), ("-1E-1", -0.1), ("7", 7.0)],
)
def test_numbers_mean_what_a_person_thinks(folder: Path, written_as: str, meant: float) -> None:
    assert load_cfg(NoteCfg(), written(folder, f"number: {written_as}")).number == meant


def test_a_file_changes_what_it_names_and_lists_replace(folder: Path) -> None:
    cfg = load_train_cfg(written(folder, "seed: 5\nnetwork:\n  actor_hidden_n: [8]\nenv:\n  # nothing yet\n"))
    assert (cfg.seed, cfg.network.actor_hidden_n, cfg.network.critic_hidden_n) == (5, (8,), (256, 256))
    assert cfg.env == TrainCfg().env


def test_an_empty_file_is_the_default(folder: Path) -> None:
    assert load_train_cfg(written(folder, "# nothing\n")) == TrainCfg()


def test_a_folder_stands_for_its_config(folder: Path) -> None:
    run = folder / "run"
    run.mkdir()
    written(run, "seed: 9", "config.yaml")
    assert load_train_cfg(run).seed == 9


def test_a_child_changes_its_parent(folder: Path) -> None:
    written(folder, "extends: thesis\nseed: 1\nreplay: {batch_size: 8}", "parent.yaml")
    cfg = load_train_cfg(written(folder, "extends: parent.yaml\nseed: 2"))
    assert (cfg.seed, cfg.replay.batch_size, cfg.replay.capacity) == (2, 8, 40_000)


def test_a_slip_in_the_parent_names_the_parent(folder: Path) -> None:
    written(folder, "sede: 1", "parent.yaml")
    assert message_of(written(folder, "extends: parent.yaml")) == "parent.yaml: sede: unknown; did you mean seed?"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("env:\n  observation:\n    dpeth: 4", "x.yaml: env.observation.dpeth: unknown; did you mean depth?"),
        ("observation:\n  depth: 4", "x.yaml: observation: unknown; did you mean env.observation?"),
        ("seed: 1\nseed: 2", "x.yaml: not YAML: line 2: 'seed' is given twice"),
        ("env: {camera: {fov_rad: wide}}", "x.yaml: env.camera.fov_rad: must be a finite number, got 'wide'"),
        ("env: {camera: {fov_rad: 9}}", "x.yaml: camera.fov_rad must be in (0, 2.5), got 9.0"),
        ("- seed", "x.yaml: expected settings as 'name: value' lines, got list"),
        ("seed: [1", "x.yaml: not YAML: line 1: expected ',' or ']', but got '<stream end>'"),
        ("extends: x.yaml", "x.yaml: extends itself, by way of x.yaml"),
        ("extends: [grasp, smoke]", "x.yaml: extends: must be the name of one preset or file, got ['grasp', 'smoke']"),
        (
            "extends: grap",
            "x.yaml: extends: unknown preset 'grap'; did you mean 'grasp'? "
            f"Valid: {', '.join(preset_names())}. A path to a YAML file works too.",
        ),
    ],
)
def test_a_slip_in_a_file_gets_one_clear_sentence(folder: Path, text: str, message: str) -> None:
    assert message_of(written(folder, text)) == message


def test_bytes_that_are_no_text_are_refused(folder: Path) -> None:
    path = folder / "x.yaml"
    path.write_bytes(b"seed: \xff\xfe")
    assert message_of(path).startswith("x.yaml: cannot be read: ")


def test_an_unknown_preset_lists_the_known_ones() -> None:
    with pytest.raises(ConfigError, match="unknown preset 'thesys'; did you mean 'thesis'"):
        load_train_cfg("thesys")


def test_a_missing_file_is_named(folder: Path) -> None:
    with pytest.raises(ConfigError, match=r"no settings at '.*absent\.yaml'"):
        load_train_cfg(folder / "absent.yaml")
