"""Where a known shape is in a cloud of points: iterative closest points, by Open3D."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tr_grasp.geometry import invert_transform

Array = NDArray[np.floating]
WITHIN_M = (0.03, 0.012, 0.006)
"""Points further from the shape than this have no say, in the first, second and third pass."""
ITERATIONS_N = 100


@dataclass(frozen=True)
class Registration:
    """A shape laid over a cloud.

    Attributes:
        T_cloud_shape: (4, 4) from the shape's frame to the cloud's.
        fitness: Share of the cloud's points that lie within the last distance of the shape.
        rmse_m: Root of these points' mean squared distance.
    """

    T_cloud_shape: Array
    fitness: float
    rmse_m: float


def register(points: Array, shape_points: Array, T_start: Array) -> Registration:
    """Lay a shape over a cloud that may show one side of it only.

    Every point of the cloud looks for the nearest one of the shape, so sides that the cloud does not show pull nothing.

    Args:
        points: (n, 3) the cloud.
        shape_points: (m, 3) points all over the shape, closer to each other than it has to be accurate.
        T_start: (4, 4) first guess of ``T_cloud_shape``, within 3 cm.

    Source: Besl & McKay 1992, A method for registration of 3-D shapes.
    """
    import open3d as o3d  # slow to import, and only this needs it

    cloud, shape = (
        o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.asarray(part, float))) for part in (points, shape_points)
    )
    solver = o3d.pipelines.registration
    # Point to point: planes would leave the turn of a bottle about its axis undetermined.
    way, stop = solver.TransformationEstimationPointToPoint(), solver.ICPConvergenceCriteria(1e-7, 1e-7, ITERATIONS_N)
    T_shape_cloud = invert_transform(np.asarray(T_start, float))
    for within in WITHIN_M:
        found = solver.registration_icp(cloud, shape, within, T_shape_cloud, way, stop)
        T_shape_cloud = np.asarray(found.transformation)
    return Registration(invert_transform(T_shape_cloud), float(found.fitness), float(found.inlier_rmse))


def largest_cluster(points: Array, gap_m: float = 0.015, neighbours_n: int = 5) -> Array:
    """(k, 3) of points (n, 3) those of the largest group in which each has neighbours within a gap; none if none is."""
    import open3d as o3d

    if len(points) <= neighbours_n:
        return points[:0]
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.asarray(points, float)))
    labels = np.asarray(cloud.cluster_dbscan(gap_m, neighbours_n))
    if labels.max() < 0:
        return points[:0]
    return points[labels == np.bincount(labels[labels >= 0]).argmax()]
