"""The presets that come with the package."""

from __future__ import annotations

import ast
import inspect
import math
import re
from collections.abc import Iterator
from dataclasses import is_dataclass, replace
from itertools import pairwise

import pytest
import yaml

import tr_grasp.configs as configs
from tr_grasp.configs import TrainCfg
from tr_grasp.configs.build import build, field_types, plain
from tr_grasp.configs.io import _PRESETS, load_train_cfg, preset_names

THESIS = {
    "env.control_hz": 2.5,
    "env.fresh_scene_every_n": 1,
    "env.episode_steps": 100,
    "env.initial_joint_noise_rad": 0.1,
    "env.action.translation_step_m": 0.1,
    "env.action.yaw_step_rad": math.pi / 4,
    "env.action.gripper_dead_zone": 0.0,
    "env.workspace.side_m": 0.24,
    "env.objects.orientation": "thesis",
    "env.objects.count_range": [4, 4],
    "env.objects.diagonal_range_m": [0.125, 0.175],
    "env.objects.mass_range_kg": [0.05, 0.25],
    "env.objects.friction_range": [0.75, 1.5],
    "env.camera.depth_noise_m": 0.001,
    "env.camera.arc.direction_x": [-1.0, 1.0],
    "env.camera.arc.direction_y": [-1.0, 1.0],
    "env.camera.arc.direction_z": [0.1, 0.7],
    "env.camera.arc.distance_m": [1.0, 1.0],
    "env.camera.arc.behind_robot_rad": math.pi / 8,
    "env.randomise.object_properties": True,
    "env.randomise.object_poses": True,
    "env.randomise.initial_joints": True,
    "env.randomise.camera_pose": True,
    "env.randomise.depth_noise": "gaussian",
    "env.randomise.ground_texture": True,
    "env.randomise.gravity": False,
    "env.randomise.latency": False,
    "env.observation.depth": 4,
    "env.observation.colour": True,
    "env.observation.stack_n": 3,
    "env.observation.gripper_reading": "commanded",
    "env.reward.stage_base": 7.0,
    "env.reward.ground_contact": -1.0,
    "env.reward.step": -0.005,
    "env.reward.reach_distance_m": 0.1,
    "env.reward.lift_height_m": 0.125,
    "env.reward.lift_reference": "table",
    "network.encoder": "vanilla_ocnn",
    "network.shared_stack": False,
    "network.node_set": "siblings",
    "network.actor_hidden_n": [512, 512],
    "network.critic_hidden_n": [512, 512],
    "network.log_std_init": 0.0,
    "network.critic_layer_norm": False,
    "network.critic_sees_stages": False,
    "network.target_statistics": "initial",
    "algorithm.critics_n": 2,
    "algorithm.quantiles_n": 25,
    "algorithm.drop_per_net": 3,
    "algorithm.gamma": 0.999,
    "algorithm.tau": 5e-5,
    "algorithm.reward_scale": 1.0,
    "algorithm.alpha_init": 0.1,
    "algorithm.alpha_min": 0.0,
    "algorithm.target_entropy": -5.0,
    "algorithm.encoder_grad": "actor",
    "algorithm.critic_reduction": "mean",
    "algorithm.normalise_actor_loss": False,
    "algorithm.actor_warmup_updates": 0,
    "algorithm.action_noise": 0.025,
    "optimiser.learning_rate": 1.5e-4,
    "optimiser.decay_start": 0.0,
    "optimiser.final_fraction": 0.0,
    "optimiser.gradient_clip": 0.0,
    "optimiser.averaging": 0.0,
    "replay.capacity": 40_000,
    "replay.batch_size": 32,
    "replay.symmetry_augmentation": False,
    "replay.timeout": "terminal",
    "demonstrations.transitions_n": 0,
    "imitation.pretrain_updates": 0,
    "imitation.weight_initial": 0.0,
    "imitation.weight_final": 0.0,
    "imitation.reinforcement": True,
    "trainer.env_steps": 500_000,
    "trainer.updates_per_step": 0.0,
    "trainer.updates_per_episode": 100,
    "trainer.learning_starts": 0,
    "trainer.random_steps": 0,
}


def leaves(tree: dict, prefix: str = "") -> Iterator[tuple[str, object]]:
    for name, value in tree.items():
        if isinstance(value, dict):
            yield from leaves(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


def test_the_thesis_preset_has_the_values_of_the_thesis() -> None:
    found = dict(leaves(plain(load_train_cfg("thesis"))))
    assert {path: found[path] for path in THESIS} == THESIS


def test_dagger_imitates_every_state_and_reinforces_none() -> None:
    cfg = load_train_cfg("dagger")
    assert (cfg.imitation.states, cfg.imitation.reinforcement) == ("all", False)


def test_vanilla_is_our_recipe_with_another_encoder() -> None:
    ours, vanilla = load_train_cfg("grasp"), load_train_cfg("vanilla")
    assert vanilla.network.encoder == "vanilla_ocnn"
    assert (vanilla.algorithm, vanilla.optimiser) == (ours.algorithm, ours.optimiser)
    three = replace(ours.env.observation, stack_n=3)
    assert vanilla.env == replace(ours.env, observation=three)


def test_the_repaired_thesis_differs_in_its_quirks_alone() -> None:
    one, other = (dict(leaves(plain(load_train_cfg(name)))) for name in ("thesis", "thesis_fixed"))
    assert {path for path in one if one[path] != other[path]} == {
        "env.objects.orientation",
        "env.observation.gripper_reading",
        "env.reward.lift_reference",
        "network.target_statistics",
        "algorithm.encoder_grad",
        "replay.timeout",
        "trainer.updates_per_step",
        "trainer.updates_per_episode",
    }


@pytest.mark.parametrize(
    ("number", "robot", "encoder", "colour", "heads", "batch"),
    [
        (1, "panda", "vanilla_ocnn", False, "vanilla", 32),
        (2, "panda", "vanilla_ocnn", True, "vanilla", 32),
        (3, "panda", "residual_ocnn", True, "vanilla", 32),
        (4, "ur5_rg2", "residual_ocnn", True, "vanilla", 32),
        (5, "ur5_rg2", "residual_ocnn", True, "vanilla", 32),
        (6, "panda", "residual_ocnn", True, "advanced", 32),
        (7, "ur5_rg2", "residual_ocnn", True, "advanced", 32),
        (8, "ur5_rg2", "o_ahrnet", True, "vanilla", 8),
        (9, "ur5_rg2", "o_ahrnet", True, "vanilla", 32),
    ],
)
def test_the_nine_experiments_are_those_of_table_5_6(
    number: int, robot: str, encoder: str, colour: bool, heads: str, batch: int
) -> None:
    cfg = load_train_cfg(f"experiment_{number}")
    assert (cfg.env.robot, cfg.network.encoder, cfg.env.observation.colour) == (robot, encoder, colour)
    assert (cfg.network.heads, cfg.replay.batch_size) == (heads, batch)
    assert cfg.network.num_blocks == (4 if number in (4, 5, 6, 7) else 2)
    assert cfg.network.norm == ("batch" if number == 4 else "none")


def test_smoke_is_tiny() -> None:
    cfg = load_train_cfg("smoke")
    assert cfg.trainer.env_steps * cfg.env.episode_steps <= 1_000
    assert cfg.trainer.collector == "inline"


def test_the_package_offers_these_presets() -> None:
    experiments = [f"experiment_{i}" for i in range(1, 10)]
    ours = ["dagger", "demonstrations", "grasp", "smoke", "ur5_rg2", "vanilla"]
    assert preset_names() == sorted([*ours, *experiments, "thesis", "thesis_fixed"])


@pytest.mark.parametrize("name", sorted(set(preset_names()) - {"thesis"}))  # pins its values, whatever ours become
def test_a_preset_says_only_what_its_parent_does_not(name: str) -> None:
    text = yaml.safe_load((_PRESETS / f"{name}.yaml").read_text()) or {}
    parent = load_train_cfg(text.pop("extends")) if "extends" in text else TrainCfg()
    whole, repeated = plain(build(parent, {})), []
    for path, _ in leaves(text):
        inherited = dict(leaves(whole))[path]
        if dict(leaves(plain(load_train_cfg(name))))[path] == inherited:
            repeated.append(path)
    assert repeated == []


def values_that_docstrings_ascribe_to_the_thesis(cfg_class: type, prefix: str = "") -> Iterator[tuple[str, float]]:
    """Settings whose docstring says ``thesis: 0.1``, with that number."""
    body = next(iter(ast.parse(inspect.getsource(cfg_class)).body)).body
    docs = {
        node.target.id: after.value.value
        for node, after in pairwise(body)
        if isinstance(node, ast.AnnAssign) and isinstance(after, ast.Expr)
    }
    for name, hint in field_types(cfg_class).items():
        if is_dataclass(hint):
            yield from values_that_docstrings_ascribe_to_the_thesis(hint, f"{prefix}{name}.")
        elif number := re.search(r"thesis: (-?\d+\.?\d*)", docs[name]):
            yield f"{prefix}{name}", float(number.group(1))


def test_the_thesis_preset_keeps_the_word_of_the_docstrings() -> None:
    found = dict(leaves(plain(load_train_cfg("thesis"))))
    said = dict(values_that_docstrings_ascribe_to_the_thesis(TrainCfg))
    assert said["algorithm.target_entropy"] == -5.0
    assert {path: found[path] for path in said} == said


def undocumented_fields(source: str) -> list[str]:
    """Fields of ``*Cfg`` classes that no docstring follows."""
    missing = []
    for cfg in ast.parse(source).body:
        if isinstance(cfg, ast.ClassDef) and cfg.name.endswith("Cfg"):
            for node, after in zip(cfg.body, [*cfg.body[1:], None], strict=True):
                documented = isinstance(after, ast.Expr) and isinstance(getattr(after, "value", None), ast.Constant)
                if isinstance(node, ast.AnnAssign) and not documented:
                    missing.append(f"{cfg.name}.{ast.unparse(node.target)}")
    return missing


def test_every_setting_has_a_docstring_because_that_is_its_help() -> None:
    modules = {inspect.getmodule(getattr(configs, name)) for name in configs.__all__}
    assert [field for module in modules for field in undocumented_fields(inspect.getsource(module))] == []


def test_a_setting_without_docstring_is_found() -> None:
    body = ["x: int = 1", "'About x.'", "y: int = 2", "z: int = 3", "'About z.'", "w: int = 4"]
    source = "class ACfg:\n" + "".join(f"    {line}\n" for line in body)
    assert undocumented_fields(source) == ["ACfg.y", "ACfg.w"]
