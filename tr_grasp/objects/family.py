"""What a procedural family is: named dimensions with ranges, and a function that builds the solids."""

from __future__ import annotations

import inspect
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import trimesh
from numpy.typing import NDArray

from tr_grasp.objects.model import ObjectModel

Split = Literal["train", "test"]
SPLITS: tuple[Split, Split] = ("train", "test")

OUTER_SHARE = 0.15
"""Share of every range, at either end, that is kept for the test split."""

Range = tuple[float, float]
Groups = Sequence[Sequence[trimesh.Trimesh]]
Builder = Callable[..., Groups]


@dataclass(frozen=True)
class Family:
    """A kind of object; ``build(**dimensions)`` gives its convex solids, grouped by what shares a colour."""

    name: str
    ranges: dict[str, Range]
    """Smallest and largest value of each dimension [m, rad]."""

    build: Builder
    held_out: bool
    """True for families of which training never sees any member."""

    def draw(self, split: Split, rng: np.random.Generator) -> dict[str, float]:
        """Dimensions of a random member: from the middle of each range to train, from its two ends to test."""
        return {name: low + (high - low) * _draw_share(split, rng) for name, (low, high) in self.ranges.items()}

    def sample(self, split: Split, rng: np.random.Generator) -> ObjectModel:
        """A random member with random colours; its name tells its dimensions apart from others."""
        return self.model(self.draw(split, rng), rng)

    def model(self, dimensions: dict[str, float], rng: np.random.Generator) -> ObjectModel:
        """The member with these dimensions, in random colours."""
        groups = self.build(**dimensions)
        parts = [part for group in groups for part in group]
        visual = _joined(parts)
        group_faces = [sum(len(part.faces) for part in group) for group in groups]
        colours = np.repeat(_group_colours(len(groups), rng), group_faces, axis=0)
        digest = zlib.crc32(np.array(list(dimensions.values())).tobytes())
        return ObjectModel.assemble(f"{self.name}-{digest:08x}", self.name, parts, visual, colours)


def family(*, held_out: bool = False, **ranges: Range) -> Callable[[Builder], Family]:
    """Turn a builder into the family of its name, with a range for each of its arguments.

    Raises:
        TypeError: If the ranges are not those of the builder's arguments, or not low < high.
    """

    def named(build: Builder) -> Family:
        if list(ranges) != list(inspect.signature(build).parameters):
            raise TypeError(f"ranges of family {build.__name__} must be those of its arguments, in order")
        if not all(low < high for low, high in ranges.values()):
            raise TypeError(f"every range of family {build.__name__} must be low < high, got {ranges}")
        return Family(build.__name__, ranges, build, held_out)

    return named


def _draw_share(split: Split, rng: np.random.Generator) -> float:
    if split == "train":
        return rng.uniform(OUTER_SHARE, 1 - OUTER_SHARE)
    share = rng.uniform(0, 2 * OUTER_SHARE)
    return share if share < OUTER_SHARE else 1 - 2 * OUTER_SHARE + share


def _group_colours(groups_n: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """One colour for the whole object half of the time, else one for each group."""
    colours = rng.uniform(0.05, 0.95, (groups_n, 3))
    return np.repeat(colours[:1], groups_n, axis=0) if rng.random() < 0.5 else colours


def _joined(parts: Sequence[trimesh.Trimesh]) -> trimesh.Trimesh:
    offsets = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    faces = [part.faces + offset for part, offset in zip(parts, offsets, strict=True)]
    return trimesh.Trimesh(np.concatenate([part.vertices for part in parts]), np.concatenate(faces), process=False)
