"""What an arm must not touch: boxes, convex bodies and point clouds, at rest or moving."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import coal
import numpy as np
from numpy.typing import ArrayLike

from tr_grasp.errors import MotionError
from tr_grasp.motion.arguments import Array, positive, transforms

Motion = Callable[[Array], Array]
"""``T_base_obstacle`` (n, 4, 4) at times (n,) [s]."""


@dataclass(frozen=True, eq=False)
class Obstacle:
    """A body in the base frame; made by :func:`box`, :func:`convex` or :func:`point_cloud`.

    Attributes:
        name: In reports of contacts.
        geometry: Its shape, for coal.
        T_base_obstacle: Where it is, if it stands still.
        motion: Where it is at which time, if it moves.
        may_touch: Links of the robot that are allowed to touch it, such as the fingers that will hold it.
    """

    name: str
    geometry: coal.CollisionGeometry = field(repr=False)
    T_base_obstacle: Array
    motion: Motion | None = None
    may_touch: tuple[str, ...] = ()

    def poses(self, times_s: Array) -> Array:
        """``T_base_obstacle`` (n, 4, 4) at times (n,).

        Raises:
            MotionError: Its motion gives something else.
        """
        if self.motion is None:
            return np.broadcast_to(self.T_base_obstacle, (len(times_s), 4, 4))
        T = transforms(f"the motion of {self.name!r}", self.motion(times_s))
        if len(T) != len(times_s):
            raise MotionError(f"the motion of {self.name!r} must give {len(times_s)} poses, got {len(T)}.")
        return T


def box(
    name: str,
    size_m: ArrayLike,
    T_base_box: ArrayLike,
    *,
    margin_m: float = 0.0,
    motion: Motion | None = None,
    may_touch: tuple[str, ...] = (),
) -> Obstacle:
    """A box of edges (3,) around its frame's origin; the margin grows it to all sides.

    Raises:
        MotionError: An edge that is not positive, a pose that is not rigid, or a negative margin.
    """
    size = np.array([positive(f"size_m of {name!r}", edge) for edge in np.ravel(size_m)])
    if len(size) != 3:
        raise MotionError(f"size_m of {name!r} must be three edges, got {len(size)}.")
    geometry = coal.Box(*(size + 2 * _margin(margin_m)))
    return Obstacle(name, geometry, transforms(f"the pose of {name!r}", T_base_box), motion, may_touch)


def convex(
    name: str,
    points_m: ArrayLike,
    T_base_body: ArrayLike,
    *,
    margin_m: float = 0.0,
    motion: Motion | None = None,
    may_touch: tuple[str, ...] = (),
) -> Obstacle:
    """The convex hull of points (n, 3) in the body's own frame; a mesh is one obstacle for each of its convex parts.

    Raises:
        MotionError: Points that span no volume, a pose that is not rigid, or a negative margin.
    """
    points = np.asarray(points_m, float)
    if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():
        raise MotionError(f"points_m of {name!r} must be finite points (n, 3), got an array of shape {points.shape}.")
    if len(points) < 4 or np.linalg.matrix_rank(points - points.mean(0), tol=1e-7) < 3:
        raise MotionError(f"points_m of {name!r} must span a volume; {len(points)} points in one plane do not.")
    vertices = coal.StdVec_Vec3s()
    vertices.extend(list(points))
    geometry = coal.Convex.convexHull(vertices, False, "Qt")
    geometry.setSweptSphereRadius(_margin(margin_m))
    return Obstacle(name, geometry, transforms(f"the pose of {name!r}", T_base_body), motion, may_touch)


def point_cloud(
    name: str, points_base_m: ArrayLike, resolution_m: float = 0.02, *, may_touch: tuple[str, ...] = ()
) -> Obstacle:
    """Points (n, 3) in the base frame as an octree: every leaf that holds a point is solid.

    Raises:
        MotionError: No points, NaN, or a resolution that is not positive.
    """
    points = np.ascontiguousarray(points_base_m, float)
    if points.ndim != 2 or points.shape[1:] != (3,) or not len(points) or not np.isfinite(points).all():
        raise MotionError(f"points of {name!r} must be finite (n, 3) with n ≥ 1, got an array of shape {points.shape}.")
    geometry = coal.makeOctree(points, positive("resolution_m", resolution_m))
    return Obstacle(name, geometry, np.eye(4), None, may_touch)


def _margin(margin_m: float) -> float:
    if not np.isfinite(margin_m) or margin_m < 0:
        raise MotionError(f"margin_m must be zero or more, got {margin_m}.")
    return float(margin_m)
