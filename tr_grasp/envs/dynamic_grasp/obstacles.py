"""What stands beside the path: three objects in three of five regions."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tr_grasp.objects import ObjectModel, shapes
from tr_grasp.objects.conveyor import ConveyorObject, conveyor_object

Array = NDArray[np.floating]

CAN = "005_tomato_soup_can"
OBSTACLES = (CAN, "035_power_drill", "021_bleach_cleanser")
CAN_RADIUS_M, CAN_HEIGHT_M, CAN_KG = 0.0339, 0.1018, 0.349
PATH_M, GAP_M = 1.0, 0.05
OFFSET_M = (0.15, 0.25)
REGION_M = (PATH_M - 2 * GAP_M) / 3
REGIONS = ((1, -1), (1, 0), (1, 1), (-1, -1), (-1, 1))
"""Side of the path, 1 for the far one, and third of its length. The near middle stays empty: the arm comes there."""
CLEAR_M = 0.01
"""The target passes every obstacle with this gap at least: what the carrier overturns, no method can help."""


@dataclass(frozen=True)
class Line:
    """A path that is perpendicular to the radius through its middle."""

    distance_m: float
    theta_rad: float

    def point(self, outward_m: float, along_m: float) -> tuple[float, float]:
        """(x, y) [m] beside the middle: outward from the base, and along the path."""
        c, s = np.cos(self.theta_rad), np.sin(self.theta_rad)
        radius = self.distance_m + outward_m
        return float(c * radius - s * along_m), float(s * radius + c * along_m)


@dataclass(frozen=True)
class Standing:
    """An obstacle on the floor."""

    name: str
    x_m: float
    y_m: float
    yaw_rad: float


@lru_cache(maxsize=32)
def known_object(name: str, folder: str | Path | None = None) -> ConveyorObject:
    """A target or obstacle; those of a folder are read once. The can is always a plain solid.

    Raises:
        ConfigError: No such object or folder.
        MeshError: Its files cannot be used.
    """
    if name != CAN:
        return conveyor_object(name, folder)
    solid = shapes.cylinder(CAN_RADIUS_M, 0.0, CAN_HEIGHT_M, sides=16)
    colours = np.tile((0.80, 0.20, 0.15), (len(solid.faces), 1))
    return ConveyorObject(CAN, ObjectModel.assemble(CAN, CAN, [solid], solid, colours), CAN_KG)


def draw_obstacles(line: Line, target: str, target_yaw_rad: float, rng: np.random.Generator) -> tuple[Standing, ...]:
    """Each obstacle in a region of its own, somewhere in there, turned anyhow; never in the target's way."""
    regions = rng.permutation(len(REGIONS))[: len(OBSTACLES)]
    return tuple(
        _draw(line, name, REGIONS[k], (target, target_yaw_rad), rng) for name, k in zip(OBSTACLES, regions, strict=True)
    )


def _draw(
    line: Line, name: str, region: tuple[int, int], target: tuple[str, float], rng: np.random.Generator
) -> Standing:
    side, third = region
    while True:
        yaw = rng.uniform(-np.pi, np.pi)
        offset, along = rng.uniform(*OFFSET_M), third * (REGION_M + GAP_M) + REGION_M * rng.uniform(-0.5, 0.5)
        obstacle_yaw, target_yaw = (line.theta_rad - angle for angle in (yaw, target[1]))
        # Both seen along the path: how far the obstacle reaches inward, and the target towards it.
        widths = _reach(name, obstacle_yaw, -side) + _reach(target[0], target_yaw, side)
        if offset >= widths + CLEAR_M:
            x, y = line.point(side * offset, along)
            return Standing(name, x, y, float(yaw))


def _reach(name: str, outward_rad: float, side: int) -> float:
    """How far an object reaches from its origin, outward (1) or inward (-1); the direction is seen from the object."""
    direction = side * np.array([np.cos(outward_rad), np.sin(outward_rad)])
    points = np.concatenate([part.vertices for part in known_object(name).model.parts])
    return float((points[:, :2] @ direction).max())
