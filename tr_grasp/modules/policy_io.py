"""A trained policy as a folder: weights, the settings it was trained with, and the record of its training."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from tensordict.nn import TensorDictModuleBase

from tr_grasp.configs import TrainCfg
from tr_grasp.configs.io import dump_yaml, load_train_cfg
from tr_grasp.errors import CheckpointError, ConfigError, unknown_name
from tr_grasp.files import make_folder, write_atomically
from tr_grasp.modules.agent import Agent, EnvSpec, build_agent
from tr_grasp.octree import OctreeSpec

FORMAT = "tr_grasp.policy"
VERSION = 1
"""Rises when saved weights stop fitting the networks that this package builds."""

WEIGHTS_FILE = "policy.safetensors"
CONFIG_FILE = "config.yaml"
RECORD_FILE = "training.json"

_SHIPPED = Path(__file__).parents[1] / "policies"


def shipped_policies() -> list[str]:
    """Names of the policies that come with the package."""
    return sorted(path.parent.name for path in _SHIPPED.glob(f"*/{WEIGHTS_FILE}"))


def save_policy(folder: str | Path, agent: Agent, cfg: TrainCfg, record: Mapping[str, Any]) -> None:
    """Write encoder and actor, the settings, and the record of the training.

    Args:
        folder: Made if it does not exist; each file in it is replaced in one step.
        agent: Its critics are not saved.
        cfg: The settings of the run.
        record: JSON-compatible: command, commit, seed, steps, wall seconds, versions, curve.

    Raises:
        StorageError: It could not be written; files that were there before are still whole.
    """
    folder = Path(folder)
    make_folder(folder)
    weights = {name: tensor.detach().cpu().contiguous() for name, tensor in _policy_weights(agent).items()}
    env_spec = json.dumps(dataclasses.asdict(agent.env_spec))
    write_atomically(folder / CONFIG_FILE, dump_yaml(cfg))
    write_atomically(folder / RECORD_FILE, json.dumps(record, indent=2) + "\n")
    metadata = {"format": FORMAT, "version": str(VERSION), "env_spec": env_spec}
    write_atomically(folder / WEIGHTS_FILE, save(weights, metadata))


def load_policy(name_or_folder: str | Path) -> tuple[TensorDictModuleBase, TrainCfg]:
    """A policy in evaluation mode, on the CPU, and the settings it was trained with.

    Args:
        name_or_folder: A shipped policy (``panda``) or a folder that :func:`save_policy` wrote.

    Raises:
        CheckpointError: No such policy, or one whose files are missing, corrupt, foreign or of another version.
    """
    agent, cfg = load_agent(name_or_folder)
    return agent.policy.eval().requires_grad_(False), cfg


def load_agent(name_or_folder: str | Path) -> tuple[Agent, TrainCfg]:
    """As :func:`load_policy`, for training on: the whole agent, its critics with fresh weights."""
    folder = find_policy(name_or_folder)
    cfg = _load_config(folder)
    weights, env_spec = _load_weights(folder / WEIGHTS_FILE)
    agent = build_agent(cfg, env_spec)
    try:
        for part in ("encoder", "actor"):
            getattr(agent, part).load_state_dict(_part(weights, part))
    except RuntimeError as error:
        raise CheckpointError(
            f"the weights in '{folder / WEIGHTS_FILE}' do not fit the networks of its {CONFIG_FILE}: "
            f"{_first_problem(error)}."
        ) from error
    return agent, cfg


def find_policy(name_or_folder: str | Path) -> Path:
    """The folder of a shipped policy or of a saved one.

    Raises:
        CheckpointError: There is none.
    """
    if str(name_or_folder) in shipped_policies():
        return _SHIPPED / str(name_or_folder)
    folder = Path(name_or_folder)
    if folder.is_dir():
        return folder
    if len(folder.parts) > 1 or folder.exists():
        raise CheckpointError(f"no policy at '{folder}': a saved policy is a folder with {WEIGHTS_FILE}.")
    raise CheckpointError(
        f"{unknown_name('policy', str(name_or_folder), shipped_policies())} The folder of a saved policy works too."
    )


def _policy_weights(agent: Agent) -> dict[str, torch.Tensor]:
    return {
        f"{part}.{name}": tensor
        for part in ("encoder", "actor")
        for name, tensor in getattr(agent, part).state_dict().items()
    }


def _part(weights: Mapping[str, torch.Tensor], part: str) -> dict[str, torch.Tensor]:
    prefix = f"{part}."
    return {name.removeprefix(prefix): tensor for name, tensor in weights.items() if name.startswith(prefix)}


def _load_config(folder: Path) -> TrainCfg:
    path = folder / CONFIG_FILE
    if not path.is_file():
        raise CheckpointError(f"'{folder}' is not a saved policy: {CONFIG_FILE} is missing.")
    try:
        return load_train_cfg(path)
    except ConfigError as error:
        raise CheckpointError(f"'{folder}' is of another version or damaged: {error}") from error


def _load_weights(path: Path) -> tuple[dict[str, torch.Tensor], EnvSpec]:
    if not path.is_file():
        raise CheckpointError(f"'{path.parent}' is not a saved policy: {path.name} is missing.")
    try:
        with safe_open(path, framework="pt") as file:
            env_spec = _check_metadata(path, file.metadata() or {})
            weights = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 (not a dict)
    except (SafetensorError, OSError) as error:
        raise CheckpointError(f"'{path}' is corrupt: {error}.") from error
    if broken := [name for name, tensor in weights.items() if not torch.isfinite(tensor).all()]:
        raise CheckpointError(f"'{path}' is corrupt: {broken[0]} has values that are not finite.")
    return weights, env_spec


def _check_metadata(path: Path, metadata: Mapping[str, str]) -> EnvSpec:
    if metadata.get("format") != FORMAT:
        raise CheckpointError(f"'{path}' holds no policy of this package: its format is {metadata.get('format')!r}.")
    if metadata.get("version") != str(VERSION):
        raise CheckpointError(
            f"'{path}' has version {metadata.get('version')}, this package reads version {VERSION}; "
            "train it again or use the release that wrote it."
        )
    try:
        sizes = json.loads(metadata["env_spec"])
        octree = sizes.pop("octree")
        return EnvSpec(octree=OctreeSpec(**{**octree, "origin_m": tuple(octree["origin_m"])}), **sizes)
    except (KeyError, TypeError, ValueError) as error:
        raise CheckpointError(f"'{path}' is corrupt: the sizes in its header cannot be read.") from error


def _first_problem(error: RuntimeError) -> str:
    lines = [line.strip() for line in str(error).splitlines()[1:]] or [str(error)]
    return lines[0].rstrip(".")
