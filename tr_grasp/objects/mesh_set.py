"""Objects from a folder of meshes, rescaled at random."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np

from tr_grasp.errors import ConfigError, MeshError
from tr_grasp.objects.family import Split
from tr_grasp.objects.layouts import ObjectFiles
from tr_grasp.objects.meshes import load_files
from tr_grasp.objects.model import ObjectModel
from tr_grasp.objects.rejection import RejectedMesh, Rejection
from tr_grasp.objects.splits import Overlap, objects_of

NAMED_N = 3
"""Rejected objects that a sentence names; the others are in ``MeshSet.rejected``."""


class MeshSet:
    """Random objects of a folder, drawn with replacement, with a random bounding-box diagonal.

    Every sub-folder is one object, in this project's layout (``visual.ply``, ``collision.obj``) or in that of Google
    Scanned Objects (``meshes/model.obj``); ManiSkill's ``mani_skill2_ycb`` folder is a set, too. ``splits.objects_of``
    says which objects belong to which split. All meshes are read and checked at once and kept; those that cannot be
    used are left out with a warning.

    Args:
        folder: Where the objects are.
        split: Which of them to use.
        diagonal_range_m: Diagonals are uniform in this range (thesis: 0.125 to 0.175 m); none leaves every object as
            large as it is.
        at_least_n: Fewest objects that make a set.
        overlap: What to do with test objects that are training objects, too (see ``splits.objects_of``).

    Attributes:
        names: The objects that are drawn from, sorted.
        rejected: The objects that were left out, and why.

    Raises:
        ConfigError: The range is not 0 < low <= high, or train and test share an object and that is refused.
        MeshError: There are too few usable objects.
    """

    def __init__(
        self,
        folder: Path,
        split: Split,
        diagonal_range_m: tuple[float, float] | None,
        *,
        at_least_n: int = 1,
        overlap: Overlap = "refuse",
    ) -> None:
        if diagonal_range_m is not None and not 0 < diagonal_range_m[0] <= diagonal_range_m[1]:
            raise ConfigError(f"objects.diagonal_range_m must be 0 < low <= high, got {diagonal_range_m}")
        found, left_out = objects_of(folder, split, overlap)
        loaded = [_loaded(files) for files in found]
        self.diagonal_range_m = diagonal_range_m
        self._objects = tuple(model for model in loaded if isinstance(model, ObjectModel))
        self.names = tuple(model.name for model in self._objects)
        self.rejected = (*left_out, *(model for model in loaded if isinstance(model, Rejection)))
        if len(self._objects) < at_least_n:
            raise MeshError(_too_few(folder, split, len(self._objects), at_least_n, self.rejected))
        if self.rejected:
            warnings.warn(
                f"{len(self.rejected)} of the {len(found) + len(left_out)} {split} objects in {folder} are left out:"
                f" {_named(self.rejected)}.",
                stacklevel=2,
            )

    def sample(self, rng: np.random.Generator) -> ObjectModel:
        """A random object at a random scale."""
        model = self._objects[rng.integers(len(self._objects))]
        if self.diagonal_range_m is None:
            return model
        return model.scaled(rng.uniform(*self.diagonal_range_m) / model.diagonal_m)


def _too_few(folder: Path, split: Split, usable_n: int, at_least_n: int, rejected: Sequence[Rejection]) -> str:
    sentence = f"{folder} holds {usable_n} objects but at least {at_least_n} are needed for {split}"
    if not rejected:
        return f"{sentence}; add sub-folders with collision.obj and visual.ply."
    return f"{sentence}: {len(rejected)} were left out. {rejected[0].message}"


def _named(rejected: Sequence[Rejection]) -> str:
    more = f" and {len(rejected) - NAMED_N} more" if len(rejected) > NAMED_N else ""
    return ", ".join(map(str, rejected[:NAMED_N])) + more


def _loaded(files: ObjectFiles) -> ObjectModel | Rejection:
    try:
        return _load_once(files, _newest_change(files.folder))
    except RejectedMesh as error:
        return Rejection(files.name, error.reason, str(error))


def _newest_change(folder: Path) -> int:
    return max((path.stat().st_mtime_ns for path in folder.rglob("*")), default=0)


@lru_cache(maxsize=1024)
def _load_once(files: ObjectFiles, newest_change: int) -> ObjectModel:
    """``newest_change`` makes edited files be read again."""
    return load_files(files)
