"""From a saved policy to a checked file."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tr_grasp
from tr_grasp.configs import EnvCfg
from tr_grasp.errors import ConfigError, ExportError, StorageError
from tr_grasp.files import make_folder, write_atomically
from tr_grasp.modules.agent import EnvSpec
from tr_grasp.modules.export.dense_policy import DensePolicy
from tr_grasp.modules.export.formats import (
    ExportFormat,
    check_onnx_packages,
    export_onnx,
    export_torch,
    open_onnx,
    open_torch,
)
from tr_grasp.modules.export.parity import TOLERANCE, Parity, measure_parity, random_observations
from tr_grasp.modules.policy_io import RECORD_FILE, find_policy, load_agent
from tr_grasp.provenance import Provenance

LEAF_CHANNELS = ("normal_x", "normal_y", "normal_z", "distance", "red", "green", "blue")


@dataclass(frozen=True)
class Exported:
    """What was written."""

    path: Path
    size_bytes: int
    env_spec: EnvSpec
    parity: Parity


def export_policy(
    name_or_folder: str | Path,
    path: str | Path,
    provenance: Provenance,
    *,
    format: ExportFormat = "onnx",
    observations_n: int = 100,
) -> Exported:
    """Write a policy as one file, after it has shown to act like the policy.

    Args:
        name_or_folder: A shipped policy (``panda``) or a folder that ``save_policy`` wrote.
        path: The file; its folder is made, and a file that is there is replaced.
        provenance: Of the export.
        format: ``onnx``, or ``torch`` for ``torch.export.load``.
        observations_n: Random observations on which both act.

    Raises:
        CheckpointError: No such policy, or a damaged one.
        ExportError: An encoder that cannot be exported, a missing package, or actions that differ.
        StorageError: The file cannot be written.
    """
    if observations_n < 1:
        raise ConfigError(f"observations must be at least 1, got {observations_n}.")
    if format == "onnx":
        check_onnx_packages()
    path = Path(path)
    _make_place(path)
    agent, cfg = load_agent(name_or_folder)
    agent.eval().requires_grad_(False)
    export, reopen = (export_onnx, open_onnx) if format == "onnx" else (export_torch, open_torch)
    description = describe(agent.env_spec, cfg.env, provenance, _record(find_policy(name_or_folder)))
    content = export(DensePolicy(agent), description | {"policy": str(name_or_folder)})
    parity = measure_parity(agent, reopen(content), random_observations(agent.env_spec, observations_n))
    if not parity.largest_difference <= TOLERANCE:
        raise ExportError(
            f"the exported policy differs by {parity.largest_difference:.2g} from {name_or_folder} in an action, more "
            f"than rounding ({TOLERANCE:g}), so nothing was written."
        )
    write_atomically(path, content)
    return Exported(path, len(content), agent.env_spec, parity)


def describe(env_spec: EnvSpec, env: EnvCfg, provenance: Provenance, record: dict[str, Any]) -> dict[str, str]:
    """What somebody who has only the file must know; every value is text, numbers and lists are JSON."""
    octree, action = env_spec.octree, env.action
    facts: dict[str, Any] = {
        "format": "tr_grasp.exported_policy",
        "version": tr_grasp.__version__,
        "codes": "Morton codes of the non-empty leaves, x in the highest bit of three, -1 in slots without a leaf",
        "features": ", ".join(LEAF_CHANNELS[: octree.channels]),
        "features_units": "mean unit normal (base frame), distance of the leaf's mean point from its centre along the "
        "normal in half diagonals of a leaf, colour in [0, 1]",
        "proprio": "gripper (1 open, -1 closed), tcp_x, tcp_y, tcp_z [m, base frame], R_base_tcp[:, 0] (3), "
        "R_base_tcp[:, 1] (3)",
        "action": "dx, dy, dz, dphi, gripper, each in [-1, 1]; a gripper above 0 opens",
        "origin_m": octree.origin_m,
        "side_m": octree.side_m,
        "depth": octree.depth,
        "leaf_capacity": octree.leaf_capacity,
        "stack_n": env_spec.stack_n,
        "stack_order": "oldest first",
        "translation_step_m": action.translation_step_m,
        "yaw_step_rad": action.yaw_step_rad,
        "gripper_dead_zone": action.gripper_dead_zone,
        "control_hz": env.control_hz,
        "robot": env.robot,
        "training_command": record.get("command") or "",
        "training_commit": record.get("commit") or "",
        "export_command": provenance.command,
        "export_commit": provenance.commit or "",
    }
    return {name: fact if isinstance(fact, str) else json.dumps(fact) for name, fact in facts.items()}


def _record(folder: Path) -> dict[str, Any]:
    """How it was trained, as far as is known."""
    path = folder / RECORD_FILE
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}


def _make_place(path: Path) -> None:
    """Complain before the work and not after it."""
    make_folder(path.parent)
    if path.is_dir():
        raise StorageError(f"could not write '{path}': it is a folder; name a file in it.")
