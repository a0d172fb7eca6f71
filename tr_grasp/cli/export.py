"""``tr-grasp export``: a policy as one file that runs without this package."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from tyro.conf import Positional

from tr_grasp.configs.io import parse
from tr_grasp.provenance import provenance

if TYPE_CHECKING:
    from tr_grasp.modules.export import Exported

SUFFIXES = {"onnx": ".onnx", "torch": ".pt2"}


@dataclass(frozen=True)
class ExportCfg:
    """Write a policy as one file that runs without this package, and check that it acts the same."""

    policy: Positional[str]
    """A shipped policy (panda), or the folder of a saved one."""

    format: Literal["onnx", "torch"] = "onnx"
    """onnx, for ONNX Runtime and its like; or torch, for torch.export.load."""

    out: Path | None = None
    """The file, replaced if it is there; by default runs/export/POLICY.onnx or .pt2."""

    observations: int = 100
    """Random observations on which file and policy must act alike, to 1e-5."""


def main(args: list[str]) -> int:
    """Run the verb."""
    cfg = parse(ExportCfg, args, prog="tr-grasp export")
    # --help must not wait for torch.
    from tr_grasp.modules.export import export_policy

    out = cfg.out or Path("runs/export") / f"{Path(cfg.policy).resolve().name}{SUFFIXES[cfg.format]}"
    where_from = provenance(shlex.join(["tr-grasp", "export", *args]))
    exported = export_policy(cfg.policy, out, where_from, format=cfg.format, observations_n=cfg.observations)
    print(summary(exported))
    return 0


def summary(exported: Exported) -> str:
    """What was written, how it is called, and how well it does."""
    sizes, octree, parity = exported.env_spec, exported.env_spec.octree, exported.parity
    slots = f"batch, {sizes.stack_n}, {octree.leaf_capacity}"
    code = str(octree.code_dtype).removeprefix("torch.")
    return (
        f"file    {exported.path}, {exported.size_bytes / 1e6:.1f} MB\n"
        f"input   codes {code} ({slots})\n"
        f"        features float16 ({slots}, {octree.channels})\n"
        f"        proprio float32 (batch, {sizes.stack_n}, {sizes.proprio_n})\n"
        f"output  action float32 (batch, {sizes.action_n})\n"
        f"parity  actions differ by at most {parity.largest_difference:.1e} on {parity.observations_n} observations\n"
        f"speed   {parity.file_ms:.1f} ms an action; the policy itself {parity.policy_ms:.1f} ms"
    )
