"""What happened in one run, step by step, in one file that can be played again."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDict

from tr_grasp import keys
from tr_grasp.errors import DemonstrationError
from tr_grasp.files import make_folder, write_atomically
from tr_grasp.octree import OctreeFrame

Array = NDArray[Any]
FORMAT, VERSION = "tr_grasp.run", 1
META = "meta"


@dataclass(frozen=True, eq=False)
class RunStep:
    """One decision of the policy.

    Attributes:
        stamp_s: When, on the world's clock.
        q_rad: (dof,) measured joints.
        opening_m: Of the fingers.
        proprio: (stack, 10) as the policy saw it.
        codes, features: Of the octrees, as it saw them.
        action: (5,) what it did.
        rgb: (h, w, 3) uint8 picture.
        depth_m: (h, w) float32 depth.
    """

    stamp_s: float
    q_rad: Array
    opening_m: float
    proprio: Array
    codes: Array
    features: Array
    action: Array
    rgb: Array
    depth_m: Array

    def observation(self) -> TensorDict:
        """What the policy saw."""
        octree = OctreeFrame(
            codes=torch.from_numpy(self.codes), features=torch.from_numpy(self.features), batch_size=[len(self.codes)]
        )
        return TensorDict(
            {keys.OCTREE: octree, keys.PROPRIO: torch.from_numpy(self.proprio), keys.STAGES: torch.zeros(4)}, []
        )


@dataclass
class RunLog:
    """A run: who acted, where, and every step.

    Attributes:
        meta: Policy, arm, camera's pose, execution, outcome: JSON-compatible.
        steps: In order.
    """

    meta: dict[str, Any] = field(default_factory=dict)
    steps: list[RunStep] = field(default_factory=list)

    def save(self, path: str | Path) -> Path:
        """Write it as one compressed numpy archive.

        Raises:
            StorageError: It could not be written.
        """
        path = Path(path)
        make_folder(path.parent)
        stream = io.BytesIO()
        meta = json.dumps({"format": FORMAT, "version": VERSION, **self.meta})
        arrays: dict[str, Any] = {META: np.array(meta), **self._columns()}
        np.savez_compressed(stream, **arrays)
        write_atomically(path, stream.getvalue())
        return path

    @classmethod
    def load(cls, path: str | Path) -> RunLog:
        """Read what :meth:`save` wrote.

        Raises:
            DemonstrationError: No such file, damaged, or of another kind.
        """
        try:
            with np.load(Path(path), allow_pickle=False) as archive:
                meta = json.loads(str(archive[META]))
                columns = {name: archive[name] for name in archive.files if name != META}
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
            raise DemonstrationError(f"'{path}' cannot be read as the log of a run: {error}.") from error
        if not isinstance(meta, Mapping) or (meta.get("format"), meta.get("version")) != (FORMAT, VERSION):
            raise DemonstrationError(f"'{path}' is not the log of a run of version {VERSION}.")
        names = RunStep.__dataclass_fields__
        if columns and (missing := sorted(set(names) - set(columns))):
            raise DemonstrationError(f"'{path}' is damaged: it has no {missing[0]}.")
        steps_n = len(columns["stamp_s"]) if columns else 0
        steps = [RunStep(**{name: _item(columns[name][k]) for name in names}) for k in range(steps_n)]
        return cls({k: v for k, v in meta.items() if k not in ("format", "version")}, steps)

    def _columns(self) -> dict[str, Array]:
        names = RunStep.__dataclass_fields__ if self.steps else ()
        return {name: np.stack([np.asarray(getattr(step, name)) for step in self.steps]) for name in names}


def _item(value: Array) -> Any:
    return float(value) if np.ndim(value) == 0 else value
