"""Predicted success of grasps on an object that moves, as a file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray

from tr_grasp.errors import GraspError, unknown_name
from tr_grasp.grasps.grasp_set import GraspSet
from tr_grasp.grasps.motion_aware.network import QualityNet, inputs
from tr_grasp.grasps.poses import Grasps
from tr_grasp.grasps.tensor_file import FileKind

Array = NDArray[np.floating]
FILE = FileKind("motion-aware scorer", "tr_grasp.motion_aware.1", "train", "tr-grasp grasps motion train")
ENDING = ".motion.safetensors"
_SHIPPED = Path(__file__).parent / "weights"


@dataclass(frozen=True, eq=False)
class MotionAwareScorer:
    """How likely grasps hold while the object moves under the hand.

    Attributes:
        object_name: Of which object.
        shape_key: :func:`~tr_grasp.grasps.shape_key` of the object and gripper that it was tried with.
        network: What was fitted to the tries.
        top_mps: Fastest velocity that was tried; faster ones count as this fast.
        record: How it was made and how well it fits.
    """

    object_name: str
    shape_key: str
    network: QualityNet = field(repr=False)
    top_mps: float
    record: Mapping[str, Any] = field(default_factory=dict)

    @torch.no_grad()
    def score(self, grasps: Grasps, velocity_obj_mps: ArrayLike) -> Array:
        """(n,) probability that each grasp holds.

        Args:
            grasps: Of the object.
            velocity_obj_mps: (2,) or (3,), or one for each grasp: the object's velocity against a hand that only
                approaches, in the object's frame, as a predictor gives it; what is vertical does not count.

        Raises:
            GraspError: NaN, or another shape.
        """
        velocity = np.atleast_2d(np.asarray(velocity_obj_mps, float))
        if velocity.ndim != 2 or velocity.shape[1] not in (2, 3) or not np.isfinite(velocity).all():
            raise GraspError(f"velocity_obj_mps must be finite, (2,) or (3,), got {velocity_obj_mps!r}.")
        if len(velocity) not in (1, len(grasps)):
            raise GraspError(f"velocity_obj_mps must be one, or one for each of {len(grasps)} grasps.")
        level = np.broadcast_to(velocity[:, :2], (len(grasps), 2))
        speed = np.linalg.norm(level, axis=1, keepdims=True)
        level = level * np.minimum(1.0, self.top_mps / np.maximum(speed, 1e-9))
        return self.network(inputs(self.network.kind, grasps, level)).sigmoid().numpy().astype(float)

    def require_for(self, grasps: GraspSet) -> MotionAwareScorer:
        """Itself, if it was made for this object and gripper.

        Raises:
            GraspError: It was made for others.
        """
        if grasps.shape_key != self.shape_key:
            raise GraspError(
                f"this motion-aware scorer was made for {self.object_name!r} with another shape or gripper than the"
                f" grasps of {grasps.object_name!r}; train one: tr-grasp grasps motion train."
            )
        return self

    def save(self, path: str | Path) -> Path:
        """Write it in one step.

        Raises:
            StorageError: It could not be written.
        """
        facts = {
            "object": self.object_name,
            "shape_key": self.shape_key,
            "kind": self.network.kind,
            "top_mps": self.top_mps,
            "record": dict(self.record),
        }
        return FILE.write_network(path, self.network, facts)

    @classmethod
    def load(cls, path: str | Path) -> MotionAwareScorer:
        """Read a file that :meth:`save` wrote.

        Raises:
            GraspError: No such file, one of another kind or version, or a damaged one.
        """
        weights, facts = FILE.read_network(path)
        network = QualityNet(facts["kind"])
        network.load_state_dict(weights)
        return cls(facts["object"], facts["shape_key"], network.eval(), facts["top_mps"], facts["record"])


def shipped_scorers() -> tuple[str, ...]:
    """Objects of Task II whose scorers for the Robotiq 2F-85 come with the package."""
    return tuple(sorted(path.name.removesuffix(ENDING) for path in _SHIPPED.glob(f"*{ENDING}")))


def motion_aware_scorer(name_or_file: str | Path) -> MotionAwareScorer:
    """The scorer of an object of Task II that comes with the package, or of a file.

    Raises:
        GraspError: Neither, or a damaged file.
    """
    if str(name_or_file) in shipped_scorers():
        return MotionAwareScorer.load(_SHIPPED / f"{name_or_file}{ENDING}")
    if Path(name_or_file).is_file() or Path(name_or_file).suffix:
        return MotionAwareScorer.load(name_or_file)
    raise GraspError(unknown_name("object with a shipped motion-aware scorer", str(name_or_file), shipped_scorers()))
