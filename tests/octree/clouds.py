"""Point clouds and frames for the octree tests."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tr_grasp.octree import OctreeFrame, OctreeSpec, octrees_from_clouds

SPEC = OctreeSpec(origin_m=(0.38, -0.12, -0.0075), side_m=0.24)


class Cloud(NamedTuple):
    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    colours: NDArray[np.float64]


def random_cloud(seed: int, n: int = 300, spec: OctreeSpec = SPEC, spread: float = 1.0) -> Cloud:
    """Points in the cube, clustered about its centre if ``spread`` is less than 1."""
    rng = np.random.default_rng(seed)
    points = np.array(spec.centre_m) + rng.uniform(-0.5, 0.5, (n, 3)) * spec.side_m * spread
    normals = rng.normal(size=(n, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Cloud(points, normals, rng.uniform(size=(n, 3)))


def random_frames(batch_n: int, seed: int = 0, n: int = 300, spec: OctreeSpec = SPEC) -> OctreeFrame:
    """Frames ``(batch_n,)`` with clusters of different sizes."""
    clouds = [random_cloud(seed + i, n, spec, spread=0.4 + 0.6 * i / batch_n) for i in range(batch_n)]
    return octrees_from_clouds(clouds, spec)
