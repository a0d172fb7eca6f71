"""Where the octree's cube lies and how finely it is divided."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch

from tr_grasp.errors import ConfigError

GEOMETRY_CHANNELS = 4
"""Mean normal (3) and signed distance (1)."""

COLOUR_CHANNELS = 3
"""Mean red, green, blue."""

HALF_DIAGONAL = math.sqrt(3) / 2
"""Of a leaf, in units of its edge: the unit of the signed distance."""

DEPTHS = (3, 4, 5, 6)
"""Depths that leaves may have."""


def code_dtype(depth: int) -> torch.dtype:
    """The smallest integer type that holds every Morton code of a depth, and -1 for padding."""
    return torch.int16 if 8**depth <= torch.iinfo(torch.int16).max + 1 else torch.int32


@dataclass(frozen=True)
class OctreeSpec:
    """A cube in the base frame, divided into ``8**depth`` leaves."""

    origin_m: tuple[float, float, float]
    """Corner of the cube with the smallest coordinates (base frame)."""

    side_m: float
    """Edge of the cube."""

    depth: int = 4
    """A leaf is ``side_m / 2**depth`` wide; 3 to 6. Morton codes are int16, and int32 at depth 6."""

    leaf_capacity: int = 512
    """Leaves that a frame can hold."""

    colour: bool = True
    """Store the mean colour beside normal and distance."""

    def __post_init__(self) -> None:
        if len(self.origin_m) != 3:
            raise ConfigError(f"octree origin_m must have 3 coordinates, got {self.origin_m}.")
        if not self.side_m > 0:
            raise ConfigError(f"octree side_m must be positive, got {self.side_m}.")
        if self.depth not in DEPTHS:
            raise ConfigError(f"octree depth must be 3, 4, 5 or 6, got {self.depth}.")
        if self.leaf_capacity < 1:
            raise ConfigError(f"octree leaf_capacity must be at least 1, got {self.leaf_capacity}.")

    @property
    def channels(self) -> int:
        """Features of a leaf: 7 with colour, 4 without."""
        return GEOMETRY_CHANNELS + (COLOUR_CHANNELS if self.colour else 0)

    @property
    def code_dtype(self) -> torch.dtype:
        """int16, or int32 at depth 6."""
        return code_dtype(self.depth)

    @property
    def cells_n(self) -> int:
        """Leaves along an edge of the cube."""
        return 2**self.depth

    @property
    def leaf_m(self) -> float:
        """Edge of a leaf."""
        return self.side_m / self.cells_n

    @property
    def centre_m(self) -> tuple[float, float, float]:
        """Centre of the cube (base frame)."""
        x, y, z = self.origin_m
        return (x + self.side_m / 2, y + self.side_m / 2, z + self.side_m / 2)
