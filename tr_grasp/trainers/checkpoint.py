"""Everything that a run needs to go on, in one file that is always whole."""

from __future__ import annotations

import pickle
import random
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch

from tr_grasp.errors import CheckpointError
from tr_grasp.files import write_atomically

FORMAT = "tr_grasp.checkpoint"
VERSION = 1
CHECKPOINT_FILE = "checkpoint.pt"


def save_checkpoint(path: Path, state: Mapping[str, Any]) -> None:
    """Replace the checkpoint in one step: a process that is killed meanwhile leaves the one before.

    Args:
        path: The file.
        state: Plain containers of tensors, numbers and text.

    Raises:
        StorageError: It could not be written; the one before is still whole.
    """
    content = {"format": FORMAT, "version": VERSION, **state}
    write_atomically(path, lambda file: torch.save(content, file))


def load_checkpoint(path: Path, required: Collection[str] = ()) -> dict[str, Any]:
    """What :func:`save_checkpoint` stored; only plain data, no code, is read from the file.

    Args:
        path: The file.
        required: Entries that it must have.

    Raises:
        CheckpointError: The file is missing, corrupt, foreign, or of another version.
    """
    if not path.is_file():
        raise CheckpointError(f"there is no checkpoint at '{path}', so there is nothing to resume.")
    try:
        content = torch.load(path, map_location="cpu", weights_only=True, mmap=True)
    except (RuntimeError, OSError, EOFError, ValueError, KeyError, pickle.UnpicklingError) as error:
        raise CheckpointError(f"'{path}' is corrupt or no checkpoint: {str(error).splitlines()[0]}") from error
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise CheckpointError(f"'{path}' is no checkpoint of this package.")
    if content["version"] != VERSION:
        raise CheckpointError(
            f"'{path}' has version {content['version']}, this package reads version {VERSION}; "
            "resume with the release that wrote it."
        )
    if missing := sorted(set(required) - set(content)):
        raise CheckpointError(f"'{path}' is no whole checkpoint: {', '.join(missing)} is missing.")
    return content


def seed_everything(seed: int) -> None:
    """Seed every global random generator, those included that only others use."""
    random.seed(seed)
    np.random.seed(seed % 2**32)  # noqa: NPY002
    torch.manual_seed(seed)


def random_state() -> dict[str, Any]:
    """The state of the global random generators, that of Python's ``random`` left out.

    Nothing in a run draws from that one, and threads that are no part of it do: pings and calls of WebSockets.
    """
    _, keys, *rest = np.random.get_state()  # noqa: NPY002
    return {
        "torch": torch.get_rng_state(),
        "cuda": torch.cuda.get_rng_state_all() if torch.cuda.is_available() else [],
        "numpy": [torch.from_numpy(keys.astype(np.int64)), *rest],
    }


def set_random_state(state: Mapping[str, Any]) -> None:
    """Restore what :func:`random_state` returned."""
    torch.set_rng_state(state["torch"])
    if state["cuda"] and torch.cuda.is_available():
        torch.cuda.set_rng_state_all(state["cuda"])
    keys, *rest = state["numpy"]
    np.random.set_state(("MT19937", keys.numpy().astype(np.uint32), *rest))  # noqa: NPY002
