"""Files of this package: tensors, and facts about them in the header, each kind with a version of its own."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save

from tr_grasp.errors import GraspError
from tr_grasp.files import write_atomically


@dataclass(frozen=True)
class FileKind:
    """One kind of file.

    Attributes:
        name: What errors call it.
        format: Name and version that its header must have.
        made_by: ``build`` or ``train``.
        command: The command that makes one.
    """

    name: str
    format: str
    made_by: Literal["build", "train"]
    command: str

    def read(self, path: Path, framework: Literal["np", "pt"]) -> tuple[dict[str, Any], dict[str, str]]:
        """Tensors and header.

        Raises:
            GraspError: No such file, one of another kind or version, or a damaged one.
        """
        if not path.is_file():
            raise GraspError(f"there is no {self.name} at '{path}'; {self.made_by} one: {self.command}.")
        try:
            with safe_open(path, framework) as file:
                header = file.metadata() or {}
                tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 -- not a dict
        except (SafetensorError, OSError, ValueError) as error:
            raise GraspError(f"'{path}' is damaged or no {self.name} ({error}); {self.made_by} it again.") from error
        if header.get("format") != self.format:
            raise GraspError(f"'{path}' is not a {self.name} of this version ({self.format}); {self.made_by} it again.")
        return tensors, header

    def write_network(self, path: str | Path, network: torch.nn.Module, facts: Mapping[str, Any]) -> Path:
        """Write a network's weights in one step.

        Raises:
            StorageError: It could not be written.
        """
        weights = {name: tensor.detach().contiguous() for name, tensor in network.state_dict().items()}
        write_atomically(path, save(weights, {"format": self.format, "facts": json.dumps(facts, sort_keys=True)}))
        return Path(path)

    def read_network(self, path: str | Path) -> tuple[dict[str, torch.Tensor], dict[str, Any]]:
        """Weights and facts of a file that :meth:`write_network` wrote; raises as :meth:`read`."""
        weights, header = self.read(Path(path), "pt")
        return weights, json.loads(header["facts"])
