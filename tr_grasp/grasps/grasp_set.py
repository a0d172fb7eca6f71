"""A ranked set of grasps of one object by one gripper, as a file."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors.numpy import save

from tr_grasp.errors import GraspError, unknown_name
from tr_grasp.files import write_atomically
from tr_grasp.grasps.grippers import floating_gripper
from tr_grasp.grasps.poses import Grasps
from tr_grasp.grasps.robot_model import model_text
from tr_grasp.grasps.tensor_file import FileKind
from tr_grasp.objects import ObjectModel

Array = NDArray[np.floating]
FILE = FileKind("grasp set", "tr_grasp.grasp_set.1", "build", "tr-grasp grasps build")
ENDING = ".grasps.safetensors"
ROUNDED_TO_M = 1e-5
NORMAL_95 = 1.959964
_SHIPPED = Path(__file__).parent / "sets"


@dataclass(frozen=True, eq=False)
class GraspSet:
    """Grasps of an object, best first.

    Attributes:
        object_name: What is grasped.
        gripper: With which gripper.
        grasps: Where the hand is, in the object's frame (origin at its centre of mass).
        successes, tries: (n,) how often each held on a misplaced object.
        shape_key: :func:`shape_key` of the object and gripper that they were tried with.
        settings: What the set was made with.
        statistics: How it was made: counts and seconds.
        bounds_m: (2, 3) corners of the object's bounding box, in its frame.
    """

    object_name: str
    gripper: str
    grasps: Grasps
    successes: NDArray[np.integer]
    tries: NDArray[np.integer]
    shape_key: str
    settings: dict[str, Any] = field(default_factory=dict)
    statistics: dict[str, Any] = field(default_factory=dict)
    bounds_m: Array = field(default_factory=lambda: np.zeros((2, 3)))

    def __len__(self) -> int:
        return len(self.grasps)

    @property
    def success_rate(self) -> Array:
        """(n,) share of the tries that held."""
        return self.successes / np.maximum(self.tries, 1)

    @property
    def robustness(self) -> Array:
        """(n,) lower end of the 95 % Wilson interval of the success rate."""
        return wilson_lower(self.successes, self.tries)

    def top(self, count: int) -> GraspSet:
        """The best of them."""
        return self.subset(np.arange(min(count, len(self))))

    def subset(self, chosen: NDArray[np.integer] | NDArray[np.bool_]) -> GraspSet:
        """Those that an index or a mask chooses, in that order."""
        return GraspSet(
            self.object_name, self.gripper, self.grasps.subset(chosen), self.successes[chosen], self.tries[chosen],
            self.shape_key, self.settings, self.statistics, self.bounds_m,
        )  # fmt: skip

    def held_at_least(self, share: float) -> GraspSet:
        """Those that held in this share of their tries.

        Raises:
            GraspError: None did.
        """
        chosen = self.success_rate >= share
        if not chosen.any():
            raise GraspError(
                f"no grasp of {self.object_name!r} by {self.gripper!r} held in {100 * share:g} % of its tries, the best"
                f" in {100 * self.success_rate.max(initial=0.0):.0f} %; ask for less, or build a set with more tries."
            )
        return self.subset(chosen)

    def require_for(self, model: ObjectModel, gripper: str | None = None) -> GraspSet:
        """Itself, if it was made for this shape and gripper.

        Raises:
            GraspError: It was made for another.
        """
        if gripper is not None and gripper != self.gripper:
            raise GraspError(f"the grasps of {self.object_name!r} are for gripper {self.gripper!r}, not {gripper!r}.")
        if shape_key(model, self.gripper) != self.shape_key:
            raise GraspError(
                f"the grasps of {self.object_name!r} were made for another shape, size or gripper model than that of"
                f" {model.name!r}; build a set for it: tr-grasp grasps build."
            )
        return self

    def save(self, path: str | Path) -> Path:
        """Write it in one step.

        Raises:
            StorageError: It could not be written.
        """
        tensors = {
            "position_m": self.grasps.position_m.astype(np.float32),
            "q_wxyz": self.grasps.q_wxyz.astype(np.float32),
            "width_m": self.grasps.width_m.astype(np.float32),
            "successes": self.successes.astype(np.int32),
            "tries": self.tries.astype(np.int32),
            "bounds_m": self.bounds_m.astype(np.float32),
        }
        facts = {
            "object": self.object_name,
            "gripper": self.gripper,
            "shape_key": self.shape_key,
            "settings": self.settings,
            "statistics": self.statistics,
        }
        text = json.dumps(facts, sort_keys=True)
        digest = _digest(tensors, text)
        write_atomically(path, save(tensors, {"format": FILE.format, "facts": text, "sha256": digest}))
        return Path(path)

    @classmethod
    def load(cls, path: str | Path) -> GraspSet:
        """Read a file that :meth:`save` wrote.

        Raises:
            GraspError: No such file, one of another kind, a damaged one, or one without grasps.
        """
        path = Path(path)
        tensors, facts = _read(path)
        grasps = Grasps(*(tensors[name].astype(float) for name in ("position_m", "q_wxyz", "width_m")))
        if not len(grasps):
            raise GraspError(f"'{path}' holds no grasp; build it again.")
        return cls(
            facts["object"], facts["gripper"], grasps, tensors["successes"], tensors["tries"], facts["shape_key"],
            facts["settings"], facts["statistics"], tensors["bounds_m"].astype(float),
        )  # fmt: skip


def shape_key(model: ObjectModel, gripper: str) -> str:
    """What tells sets of different shapes and gripper models apart: a hash of both.

    Raises:
        GraspError: No such gripper.
    """
    content = hashlib.sha256(model_text(floating_gripper(gripper)).encode())
    for part in model.parts:
        content.update(np.round(np.asarray(part.vertices) / ROUNDED_TO_M).astype(np.int64).tobytes())
    return content.hexdigest()[:32]


def shipped_objects(gripper: str = "robotiq_2f85") -> tuple[str, ...]:
    """Objects whose grasps by a gripper come with the package."""
    return tuple(sorted(path.name.removesuffix(ENDING) for path in (_SHIPPED / gripper).glob(f"*{ENDING}")))


def shipped_grasp_set(object_name: str, gripper: str = "robotiq_2f85") -> GraspSet:
    """The grasps of an object of Task II that come with the package.

    Raises:
        GraspError: There are none for this object and gripper.
    """
    if object_name not in shipped_objects(gripper):
        valid = shipped_objects(gripper)
        raise GraspError(unknown_name(f"object with shipped grasps by {gripper}", object_name, valid))
    return GraspSet.load(_SHIPPED / gripper / f"{object_name}{ENDING}")


def wilson_lower(successes: NDArray[np.integer], tries: NDArray[np.integer]) -> Array:
    """(n,) lower end of the 95 % interval of a success rate; 0 without tries (Wilson 1927)."""
    n = np.maximum(tries, 1)
    p, z2 = successes / n, NORMAL_95**2
    low = (p + z2 / (2 * n) - NORMAL_95 * np.sqrt(p * (1 - p) / n + z2 / (4 * n**2))) / (1 + z2 / n)
    return np.where(np.asarray(tries) > 0, np.maximum(low, 0.0), 0.0)


def _read(path: Path) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    tensors, header = FILE.read(path, "np")
    if header.get("sha256") != _digest(tensors, header.get("facts", "")):
        raise GraspError(f"'{path}' is damaged: its content does not fit its checksum; build it again.")
    return tensors, json.loads(header["facts"])


def _digest(tensors: dict[str, NDArray[Any]], text: str) -> str:
    content = hashlib.sha256(text.encode())
    for name in sorted(tensors):
        content.update(name.encode() + np.ascontiguousarray(tensors[name]).tobytes())
    return content.hexdigest()
