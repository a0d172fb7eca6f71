"""The scene from above, as a planner of top-down grasps needs it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import grey_closing

if TYPE_CHECKING:
    from tr_grasp.sensing import RaycastScene

Array = NDArray[np.floating]
LOOK_FROM_M = 0.6


@dataclass(frozen=True)
class HeightMap:
    """The scene from above, on a square grid of the base frame.

    Attributes:
        height: (n, n) highest surface [m] at cell (i, j) with x = x0 + i * cell, y = y0 + j * cell.
        owner: (n, n) index of the object that this surface belongs to, -1 for the table.
        origin_m: (x0, y0) centre of cell (0, 0).
        cell_m: Edge of a cell.
    """

    height: Array
    owner: NDArray[np.integer]
    origin_m: tuple[float, float]
    cell_m: float


def height_map(
    scene: RaycastScene,
    poses: Array,
    objects: Sequence[int],
    centre_m: tuple[float, float],
    side_m: float,
    cell_m: float = 0.004,
) -> HeightMap:
    """Measure a square of the table z = 0 and the objects on it.

    Args:
        scene: Where the objects are.
        poses: (moving, 4, 4) ``T_base_body`` of its bodies.
        objects: Consecutive indices of the objects among them; all others are left out.
        centre_m: Middle of the square (x, y), base frame.
        side_m: Its edge.
        cell_m: Edge of a cell.
    """
    n = int(side_m / cell_m) + 1
    x0, y0 = np.array(centre_m) - (n - 1) / 2 * cell_m
    x, y = np.meshgrid(x0 + np.arange(n) * cell_m, y0 + np.arange(n) * cell_m, indexing="ij")
    rays = np.zeros((n * n, 6), np.float32)
    rays[:, 0], rays[:, 1], rays[:, 2], rays[:, 5] = x.ravel(), y.ravel(), LOOK_FROM_M, -1.0
    hits = scene.cast(rays, poses, objects)
    height = np.maximum(LOOK_FROM_M - np.where(hits.body >= 0, hits.distance, LOOK_FROM_M), 0.0)
    owner = np.where(hits.body >= 0, hits.body - objects[0], -1) if len(objects) else hits.body
    return HeightMap(height.reshape(n, n), owner.reshape(n, n), (float(x0), float(y0)), cell_m)


def height_map_of_points(
    points: Array, centre_m: tuple[float, float], side_m: float, cell_m: float = 0.004, table_m: float = 0.0
) -> HeightMap:
    """The same from a cloud of one object, all that a camera saw of it; heights are above the table.

    Cells of the object between pixels are filled; what no pixel shows, such as the foot behind it, is taken for table.

    Args:
        points: (n, 3) of the object, base frame.
        centre_m: Middle of the square (x, y), base frame.
        side_m: Its edge.
        cell_m: Edge of a cell; not less than the distance of the points.
        table_m: Height of the table.
    """
    n = int(side_m / cell_m) + 1
    origin = np.array(centre_m) - (n - 1) / 2 * cell_m
    cells = np.rint((points[:, :2] - origin) / cell_m).astype(int)
    inside = ((cells >= 0) & (cells < n)).all(axis=1)
    height = np.zeros((n, n))
    np.maximum.at(height, tuple(cells[inside].T), np.maximum(points[inside, 2] - table_m, 0.0))
    height = grey_closing(height, size=(3, 3))
    return HeightMap(height, np.where(height > 0, 0, -1), (float(origin[0]), float(origin[1])), cell_m)
