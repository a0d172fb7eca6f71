"""Weights of predictors as files: written whole, read only if they are ours and fit."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor

from tr_grasp.errors import CheckpointError, unknown_name
from tr_grasp.files import make_folder, write_atomically

FORMAT = "tr_grasp.predictor"
VERSION = 1
"""Rises when saved weights stop fitting the networks that this package builds."""

_SHIPPED = Path(__file__).parent / "weights"
_SUFFIX = ".safetensors"


def shipped_weights(kind: str | None = None) -> list[str]:
    """Names of the weights that come with the package; ``kind`` is mlp, lstm or hybrid."""
    return sorted(path.stem for path in _SHIPPED.glob(f"{kind or ''}*{_SUFFIX}"))


def save_weights(
    path: Path, kind: str, weights: Mapping[str, Tensor], settings: Mapping[str, Any], record: Mapping[str, Any]
) -> None:
    """Write weights with the record of their training, and beside them, as JSON, that record with its curve.

    Args:
        path: Ends in ``.safetensors``; its folder is made.
        kind: mlp, lstm or hybrid.
        weights: By name.
        settings: What a predictor has to know beside them; JSON-compatible.
        record: Command, commit, settings, losses; JSON-compatible. ``curve``, which is long, is not in the weights.

    Raises:
        StorageError: They could not be written.
    """
    make_folder(path.parent)
    metadata = {
        "format": FORMAT,
        "version": str(VERSION),
        "kind": kind,
        "settings": json.dumps(settings),
        "record": json.dumps({name: value for name, value in record.items() if name != "curve"}),
    }
    plain = {name: tensor.detach().cpu().contiguous() for name, tensor in weights.items()}
    write_atomically(path.with_suffix(".json"), json.dumps(record, indent=2) + "\n")
    write_atomically(path, save(plain, metadata))


def load_weights(name_or_path: str | Path, kind: str) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Weights and settings of a predictor.

    Args:
        name_or_path: Shipped weights (``mlp_linear``) or a file that :func:`save_weights` wrote.
        kind: What they have to be for: mlp, lstm or hybrid.

    Raises:
        CheckpointError: None there, or corrupt, foreign, of another version or for another kind of predictor.
    """
    path = _find(name_or_path, kind)
    try:
        with safe_open(path, framework="pt") as file:
            settings = _check(path, file.metadata() or {}, kind)
            weights = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 (not a dict)
    except (SafetensorError, OSError) as error:
        raise CheckpointError(f"'{path}' is corrupt: {error}.") from error
    if broken := [name for name, tensor in weights.items() if not torch.isfinite(tensor).all()]:
        raise CheckpointError(f"'{path}' is corrupt: {broken[0]} has values that are not finite.")
    return weights, settings


def fill(module: torch.nn.Module, weights: Mapping[str, Tensor], source: str | Path) -> None:
    """Give a module its weights.

    Raises:
        CheckpointError: They do not fit.
    """
    try:
        module.load_state_dict(dict(weights))
    except RuntimeError as error:
        problem = (error.args[0].splitlines()[1:] or [str(error)])[0].strip().rstrip(".")
        raise CheckpointError(f"the weights '{source}' do not fit the network: {problem}.") from error


def _find(name_or_path: str | Path, kind: str) -> Path:
    if str(name_or_path) in shipped_weights():
        return _SHIPPED / f"{name_or_path}{_SUFFIX}"
    path = Path(name_or_path)
    if path.is_file():
        return path
    if path.suffix == _SUFFIX or len(path.parts) > 1:
        raise CheckpointError(f"no weights at '{path}'.")
    valid = shipped_weights(kind)
    raise CheckpointError(f"{unknown_name('weights', str(name_or_path), valid)} The path of a file works too.")


def _check(path: Path, metadata: Mapping[str, str], kind: str) -> dict[str, Any]:
    if metadata.get("format") != FORMAT:
        raise CheckpointError(f"'{path}' holds no predictor of this package: its format is {metadata.get('format')!r}.")
    if metadata.get("version") != str(VERSION):
        raise CheckpointError(
            f"'{path}' has version {metadata.get('version')}, this package reads version {VERSION}; train it again."
        )
    if metadata.get("kind") != kind:
        raise CheckpointError(f"'{path}' is for a predictor of kind {metadata.get('kind')!r}, not {kind!r}.")
    try:
        return dict(json.loads(metadata["settings"]))
    except (KeyError, TypeError, ValueError) as error:
        raise CheckpointError(f"'{path}' is corrupt: its settings cannot be read.") from error
