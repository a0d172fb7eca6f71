from __future__ import annotations

import json
import shutil

import pytest
import torch
from safetensors.torch import load_file, save_file

from tests.toy_env import env_spec, make_env, train_cfg
from tr_grasp.errors import CheckpointError
from tr_grasp.keys import ACTION
from tr_grasp.modules import build_agent, load_policy, policy_io, save_policy


@pytest.fixture
def saved(tmp_path):
    cfg = train_cfg()
    agent = build_agent(cfg, env_spec(cfg.env))
    save_policy(tmp_path / "policy", agent, cfg, {"seed": 3})
    return tmp_path / "policy", agent, cfg


def rewrite_header(folder, **changes):
    path = folder / "policy.safetensors"
    metadata = {"format": "tr_grasp.policy", "version": "1", "env_spec": "{}"} | changes
    save_file(load_file(path), path, {key: value for key, value in metadata.items() if value is not None})


def test_a_policy_survives_saving_and_loading(saved):
    folder, agent, cfg = saved
    policy, loaded_cfg = load_policy(folder)
    observation = make_env(cfg.env, 0).reset()
    assert torch.equal(policy(observation.clone())[ACTION], agent.policy(observation.clone())[ACTION])
    assert loaded_cfg == cfg
    assert json.loads((folder / "training.json").read_text())["seed"] == 3
    assert not any(p.requires_grad for p in policy.parameters())
    assert not policy.training


def test_critics_are_not_saved(saved):
    names = load_file(saved[0] / "policy.safetensors")
    assert {name.split(".")[0] for name in names} == {"encoder", "actor"}


def test_saving_again_replaces_the_policy(saved):
    folder, _, cfg = saved
    other = build_agent(cfg, env_spec(cfg.env))
    save_policy(folder, other, cfg, {})
    observation = make_env(cfg.env, 0).reset()
    assert torch.equal(load_policy(folder)[0](observation.clone())[ACTION], other.policy(observation.clone())[ACTION])


def test_shipped_policies_are_found_by_name(saved, tmp_path, monkeypatch):
    shutil.copytree(saved[0], tmp_path / "shipped" / "panda")
    monkeypatch.setattr(policy_io, "_SHIPPED", tmp_path / "shipped")
    assert load_policy("panda")[1] == saved[2]
    with pytest.raises(CheckpointError, match="unknown policy 'pandda'; did you mean 'panda'"):
        load_policy("pandda")


def test_a_path_without_a_policy_is_named(tmp_path):
    with pytest.raises(CheckpointError, match="no policy at"):
        load_policy(tmp_path / "nowhere")
    with pytest.raises(CheckpointError, match=r"config\.yaml is missing"):
        load_policy(tmp_path)


def test_missing_weights_are_named(saved):
    (saved[0] / "policy.safetensors").unlink()
    with pytest.raises(CheckpointError, match=r"policy\.safetensors is missing"):
        load_policy(saved[0])


@pytest.mark.parametrize(
    "damage", [lambda content: content[: len(content) // 2], lambda content: b"no tensors", lambda _: b""]
)
def test_a_damaged_file_is_corrupt(saved, damage):
    path = saved[0] / "policy.safetensors"
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(CheckpointError, match="is corrupt"):
        load_policy(saved[0])


def test_a_foreign_file_is_refused(saved):
    rewrite_header(saved[0], format="pt")
    with pytest.raises(CheckpointError, match="no policy of this package"):
        load_policy(saved[0])


def test_another_version_is_refused(saved):
    rewrite_header(saved[0], version="99")
    with pytest.raises(CheckpointError, match="version 99, this package reads version 1"):
        load_policy(saved[0])


def test_unreadable_sizes_are_corrupt(saved):
    rewrite_header(saved[0])
    with pytest.raises(CheckpointError, match="sizes in its header"):
        load_policy(saved[0])


def test_weights_of_other_networks_are_refused(saved):
    config = saved[0] / "config.yaml"
    config.write_text(config.read_text().replace("features_n: 16", "features_n: 24"))
    with pytest.raises(CheckpointError, match="do not fit the networks"):
        load_policy(saved[0])


def test_settings_of_another_version_are_refused(saved):
    config = saved[0] / "config.yaml"
    config.write_text(config.read_text().replace("features_n", "feature_count"))
    with pytest.raises(CheckpointError, match="another version or damaged"):
        load_policy(saved[0])


def test_weights_that_are_not_finite_are_refused(saved):
    folder, agent, cfg = saved
    with torch.no_grad():
        next(agent.actor.parameters()).fill_(float("nan"))
    save_policy(folder, agent, cfg, {})
    with pytest.raises(CheckpointError, match="not finite"):
        load_policy(folder)
