"""Rays against triangles (Open3D, Embree): what a graphics driver does, without one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tr_grasp.errors import MissingSystemLibraryError

try:
    import open3d as o3d
except (ImportError, OSError) as error:  # Open3D reports a missing libusb as ImportError or OSError.
    raise MissingSystemLibraryError(
        f"Open3D cannot be loaded ({error}); install its system libraries, on Debian or Ubuntu: "
        "apt-get install libusb-1.0-0 libgl1 libgomp1"
    ) from error

Array = NDArray[np.floating]
BACKGROUND = np.array([0.7, 0.75, 0.8], np.float32)


@dataclass(frozen=True)
class Body:
    """A rigid triangle mesh.

    Attributes:
        vertices: (v, 3) [m] in the body's frame.
        faces: (f, 3) indices into the vertices, counter-clockwise from outside.
        face_colours: (f, 3) in [0, 1].
    """

    vertices: Array
    faces: NDArray[np.integer]
    face_colours: Array

    @classmethod
    def uniform(cls, vertices: ArrayLike, faces: ArrayLike, colour: ArrayLike) -> Body:
        """A body of one colour (3,)."""
        faces = np.asarray(faces)
        return cls(np.asarray(vertices, float), faces, np.broadcast_to(np.asarray(colour, float), (len(faces), 3)))


@dataclass(frozen=True)
class RayHits:
    """Where rays end.

    Attributes:
        distance: (n,) in units of each ray's direction; ``inf`` for a miss.
        body: (n,) index of the body that was hit, -1 for a miss.
        normals: (n, 3) of the triangle that was hit.
        colours: (n, 3) of the triangle that was hit.
    """

    distance: Array
    body: NDArray[np.integer]
    normals: Array
    colours: Array

    @classmethod
    def none(cls, n: int) -> RayHits:
        """``n`` rays that all miss."""
        return cls(
            np.full(n, np.inf, np.float32), np.full(n, -1), np.zeros((n, 3), np.float32), np.tile(BACKGROUND, (n, 1))
        )


class RaycastScene:
    """Rigid bodies that can be looked at.

    The acceleration structure is rebuilt for every cast: for a few hundred triangles this takes a quarter of a
    millisecond, less than one static structure per body costs in queries.

    Args:
        moving: Bodies whose poses come with every cast; they have the indices from 0.
        still: Bodies that never move, given in the base frame; they have the indices after those.
    """

    def __init__(self, moving: Sequence[Body], still: Sequence[Body] = ()) -> None:
        bodies = [*moving, *still]
        self.moving_n, self.still_n = len(moving), len(still)
        self._vertices = [np.asarray(body.vertices, np.float32) for body in bodies]
        self._faces = [np.asarray(body.faces, np.uint32) for body in bodies]
        self._colours = [np.asarray(body.face_colours, np.float32) for body in bodies]
        self._known_triangles: dict[tuple[int, ...], tuple[o3d.core.Tensor, NDArray, NDArray]] = {}
        self._boxes = np.array([_box_corners(body.vertices) for body in moving]).reshape(-1, 8, 3)

    def box_corners(self, poses: Array) -> Array:
        """(moving, 8, 3) corners [m] of the moving bodies' bounding boxes in the base frame."""
        return self._boxes @ poses[:, :3, :3].swapaxes(1, 2) + poses[:, None, :3, 3]

    def cast(self, rays: NDArray[np.float32], poses: Array, selection: Sequence[int] | None = None) -> RayHits:
        """Shoot rays at the bodies.

        Args:
            rays: (n, 6) origin and direction in the base frame.
            poses: (moving, 4, 4) ``T_base_body``.
            selection: Bodies that exist for this cast; all by default.
        """
        chosen = range(self.moving_n + self.still_n) if selection is None else selection
        if not len(chosen):
            return RayHits.none(len(rays))
        T = poses.astype(np.float32)
        faces, body_of_triangle, colour_of_triangle = self._triangles(tuple(chosen))
        scene = o3d.t.geometry.RaycastingScene(nthreads=1)
        scene.add_triangles(_tensor(np.concatenate([self._placed(body, T) for body in chosen])), faces)
        answer = scene.cast_rays(_tensor(rays), nthreads=1)
        distance = answer["t_hit"].numpy()
        hit = np.isfinite(distance)
        triangle = np.where(hit, answer["primitive_ids"].numpy(), 0)
        return RayHits(
            distance=distance,
            body=np.where(hit, body_of_triangle[triangle], -1),
            normals=answer["primitive_normals"].numpy(),
            colours=np.where(hit[:, None], colour_of_triangle[triangle], BACKGROUND),
        )

    def _triangles(self, bodies: tuple[int, ...]) -> tuple[o3d.core.Tensor, NDArray[np.integer], NDArray[np.float32]]:
        """Of some bodies together: faces (f, 3), the body of each (f,) and its colour (f, 3)."""
        if bodies not in self._known_triangles:
            offsets = np.cumsum([0] + [len(self._vertices[i]) for i in bodies])[:-1]
            faces = [self._faces[i] + np.uint32(offset) for i, offset in zip(bodies, offsets, strict=True)]
            self._known_triangles[bodies] = (
                _tensor(np.concatenate(faces)),
                np.repeat(bodies, [len(self._faces[i]) for i in bodies]),
                np.concatenate([self._colours[i] for i in bodies]),
            )
        return self._known_triangles[bodies]

    def _placed(self, body: int, T: NDArray[np.float32]) -> NDArray[np.float32]:
        """(v, 3) vertices in the base frame."""
        vertices = self._vertices[body]
        return vertices @ T[body, :3, :3].T + T[body, :3, 3] if body < self.moving_n else vertices


def _box_corners(vertices: Array) -> Array:
    """(8, 3) corners of the box around points (v, 3)."""
    bounds = np.stack([np.min(vertices, axis=0), np.max(vertices, axis=0)])
    return bounds[np.indices((2, 2, 2)).reshape(3, 8).T, np.arange(3)]


def _tensor(array: NDArray[np.generic]) -> o3d.core.Tensor:
    return o3d.core.Tensor.from_numpy(np.ascontiguousarray(array))
