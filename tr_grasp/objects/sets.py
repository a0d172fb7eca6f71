"""Where objects come from: procedural families or a folder of meshes, behind one protocol."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

import numpy as np

from tr_grasp.errors import ConfigError, unknown_name
from tr_grasp.objects.families import FAMILIES, family_names
from tr_grasp.objects.family import SPLITS, Split
from tr_grasp.objects.mesh_set import MeshSet
from tr_grasp.objects.model import ObjectModel

PROCEDURAL = "procedural"


class ObjectSet(Protocol):
    """A source of random objects."""

    @property
    def names(self) -> tuple[str, ...]:
        """What the set draws from: families, or single objects."""
        ...

    def sample(self, rng: np.random.Generator) -> ObjectModel:
        """A random object, the same for the same state of ``rng``; all names are equally likely."""
        ...


class ProceduralSet:
    """Random members of procedural families.

    Raises:
        ConfigError: If a family does not exist or the split may not use it.
    """

    def __init__(self, split: Split, families: Sequence[str] | None = None) -> None:
        allowed = family_names(split)
        for name in families or ():
            if name not in allowed:
                raise ConfigError(unknown_name(f"{split} family", name, allowed))
        self.split: Split = split
        self.names = tuple(families or allowed)

    def sample(self, rng: np.random.Generator) -> ObjectModel:
        """A random member of a random family, with random colours."""
        return FAMILIES[self.names[rng.integers(len(self.names))]].sample(self.split, rng)


def object_set(
    source: str, split: str = "train", *, diagonal_range_m: tuple[float, float] = (0.125, 0.175)
) -> ObjectSet:
    """The objects that a setting asks for.

    Args:
        source: ``procedural``, or a folder with one sub-folder per object (see ``MeshSet``).
        split: ``train`` or ``test``; a folder without sub-folders of these names serves either.
        diagonal_range_m: Range of the bounding-box diagonals to which meshes are scaled.

    Raises:
        ConfigError: If the source or split does not exist.
        MeshError: If the folder holds no usable objects.
    """
    if split not in SPLITS:
        raise ConfigError(unknown_name("objects.split", split, SPLITS))
    if source == PROCEDURAL:
        return ProceduralSet(split)
    if not Path(source).expanduser().is_dir():
        raise ConfigError(
            f"{unknown_name('objects.source', source, [PROCEDURAL])} It may also be the path of an existing folder"
            " with one sub-folder per object."
        )
    return MeshSet(Path(source).expanduser(), split, diagonal_range_m)
