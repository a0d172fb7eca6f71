"""Objects from a folder of meshes, rescaled at random."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np

from tr_grasp.errors import ConfigError, MeshError
from tr_grasp.objects.family import SPLITS, Split
from tr_grasp.objects.meshes import load_object
from tr_grasp.objects.model import ObjectModel


class MeshSet:
    """Random objects of a folder, drawn with replacement, with a random bounding-box diagonal.

    Every sub-folder is one object (see ``meshes.load_object``). If the folder has sub-folders ``train`` or ``test``,
    the objects are those of the split's sub-folder. All meshes are read and checked at once and kept.

    Args:
        folder: Where the objects are.
        split: Which sub-folder to use, where there are sub-folders for splits.
        diagonal_range_m: Diagonals are uniform in this range (thesis: 0.125 to 0.175 m).
        at_least_n: Fewest objects that make a set.

    Raises:
        ConfigError: If the range is not 0 < low <= high.
        MeshError: If there are too few objects, one of them cannot be used, or train and test share a name.
    """

    def __init__(
        self, folder: Path, split: Split, diagonal_range_m: tuple[float, float], *, at_least_n: int = 1
    ) -> None:
        low, high = diagonal_range_m
        if not 0 < low <= high:
            raise ConfigError(f"objects.diagonal_range_m must be 0 < low <= high, got {diagonal_range_m}")
        folders = object_folders(folder, split)
        if len(folders) < at_least_n:
            raise MeshError(
                f"{split_folder(folder, split)} holds {len(folders)} objects but at least {at_least_n} are needed;"
                " add sub-folders with collision.obj and visual.ply."
            )
        self.diagonal_range_m = diagonal_range_m
        self._objects = tuple(_load_once(path.resolve(), _newest_change(path)) for path in folders)
        self.names = tuple(path.name for path in folders)

    def sample(self, rng: np.random.Generator) -> ObjectModel:
        """A random object at a random scale."""
        model = self._objects[rng.integers(len(self._objects))]
        return model.scaled(rng.uniform(*self.diagonal_range_m) / model.diagonal_m)


def split_folder(folder: Path, split: Split) -> Path:
    """The folder that holds the split's objects: a sub-folder of that name if there is one for either split.

    Raises:
        MeshError: If the folder has a sub-folder for the other split alone, or both share an object's name.
    """
    present = [name for name in SPLITS if (folder / name).is_dir()]
    if not present:
        return folder
    if split not in present:
        raise MeshError(f"{folder} has {present[0]!r} but no {split!r} objects; add the sub-folder {folder / split}.")
    shared = set.intersection(*({path.name for path in _sub_folders(folder / name)} for name in present))
    if len(present) == 2 and shared:
        raise MeshError(
            f"train and test in {folder} share {', '.join(sorted(shared))}; keep every object in one of them only."
        )
    return folder / split


def object_folders(folder: Path, split: Split) -> list[Path]:
    """The split's object folders, sorted by name; errors as in ``split_folder``, and if the folder is missing."""
    if not folder.is_dir():
        raise MeshError(f"{folder} is missing or not a folder; name one with a sub-folder for each object.")
    return _sub_folders(split_folder(folder, split))


def _sub_folders(folder: Path) -> list[Path]:
    return sorted(path for path in folder.iterdir() if path.is_dir() and not path.name.startswith("."))


def _newest_change(folder: Path) -> int:
    return max((path.stat().st_mtime_ns for path in folder.iterdir()), default=0)


@lru_cache(maxsize=1024)
def _load_once(folder: Path, newest_change: int) -> ObjectModel:
    """``newest_change`` makes edited files be read again."""
    return load_object(folder)
