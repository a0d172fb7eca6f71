"""Where objects come from: procedural families or a folder of meshes, behind one protocol."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

import numpy as np

from tr_grasp.errors import ConfigError, unknown_name
from tr_grasp.objects.families import FAMILIES, WIDE, family_names
from tr_grasp.objects.family import SPLITS, Split
from tr_grasp.objects.layouts import sub_folders
from tr_grasp.objects.mesh_set import MeshSet
from tr_grasp.objects.model import ObjectModel
from tr_grasp.objects.rejection import Rejection
from tr_grasp.objects.splits import Overlap

PROCEDURAL, PROCEDURAL_WIDE = "procedural", "procedural_wide"
ROOT_VARIABLE = "TR_GRASP_OBJECTS"


class ObjectSet(Protocol):
    """A source of random objects."""

    @property
    def names(self) -> tuple[str, ...]:
        """What the set draws from: families, or single objects."""
        ...

    @property
    def rejected(self) -> tuple[Rejection, ...]:
        """What was left out of the set, and why."""
        ...

    def sample(self, rng: np.random.Generator) -> ObjectModel:
        """A random object, the same for the same state of ``rng``; all names are equally likely."""
        ...


class ProceduralSet:
    """Random members of procedural families.

    Args:
        split: ``train`` or ``test``.
        families: By name; all that are no wider than a hand by default.

    Raises:
        ConfigError: If a family does not exist or the split may not use it.
    """

    rejected: tuple[Rejection, ...] = ()
    """Nothing: every member can be simulated."""

    def __init__(self, split: Split, families: Sequence[str] | None = None) -> None:
        allowed = [*family_names(split), *WIDE]
        for name in families or ():
            if name not in allowed:
                raise ConfigError(unknown_name(f"{split} family", name, allowed))
        self.split: Split = split
        self.names = tuple(families or family_names(split))

    def sample(self, rng: np.random.Generator) -> ObjectModel:
        """A random member of a random family, with random colours."""
        name = self.names[rng.integers(len(self.names))]
        return (FAMILIES | WIDE)[name].sample(self.split, rng)


def object_set(
    source: str,
    split: str = "train",
    *,
    diagonal_range_m: tuple[float, float] | None = (0.125, 0.175),
    root: str | Path | None = None,
    overlap: Overlap = "refuse",
) -> ObjectSet:
    """The objects that a setting asks for.

    Args:
        source: ``procedural``; ``procedural_wide``, which has families that are wider than a hand besides; the path of
            a folder of objects (see ``MeshSet``); or the name of one in ``root``, such as ``household`` or ``ycb``.
        split: ``train`` or ``test``; a folder that knows no splits serves either (see ``splits.objects_of``).
        diagonal_range_m: Range of the bounding-box diagonals to which meshes are scaled; none leaves them as they are.
        root: Folder of folders of objects, by default what the environment variable ``TR_GRASP_OBJECTS`` names.
        overlap: What to do with objects that are in both splits of a folder: ``refuse`` it, or ``leave_out`` these
            objects when testing.

    Raises:
        ConfigError: The source or split does not exist, or train and test share an object and that is refused.
        MeshError: The folder holds no usable objects.
    """
    if split not in SPLITS:
        raise ConfigError(unknown_name("objects.split", split, SPLITS))
    if source == PROCEDURAL:
        return ProceduralSet(split)
    if source == PROCEDURAL_WIDE:
        return ProceduralSet(split, [*family_names(split), *WIDE])
    return MeshSet(source_folder(source, root), split, diagonal_range_m, overlap=overlap)


def source_folder(source: str, root: str | Path | None = None) -> Path:
    """The folder of a set of meshes: the one of this name in ``root``, else the one at this path.

    Raises:
        ConfigError: There is neither; the message names the sets in ``root``.
    """
    chosen = os.environ.get(ROOT_VARIABLE) if root is None else root
    base = Path(chosen).expanduser() if chosen else None
    if base is not None and not base.is_dir():
        raise ConfigError(f"the folder of object sets {base} ({ROOT_VARIABLE}) does not exist; name one that does.")
    candidates = [Path(source).expanduser()] if base is None else [base / source, Path(source).expanduser()]
    for folder in candidates:
        if folder.is_dir():
            return folder
    names = [PROCEDURAL, PROCEDURAL_WIDE, *(path.name for path in (sub_folders(base) if base else []))]
    place = f"in {base}" if base else f"in the folder that {ROOT_VARIABLE} names"
    raise ConfigError(
        f"{unknown_name('objects.source', source, names)} It may also be the path of an existing folder with one"
        f" sub-folder per object, or the name of one {place}."
    )
