"""A camera without a graphics driver: rays against triangles (Open3D, Embree)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tr_grasp.errors import MissingSystemLibraryError
from tr_grasp.sensing.camera import DepthImage, PinholeCamera

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
        return cls(np.full(n, np.inf, np.float32), np.full(n, -1), np.zeros((n, 3)), np.tile(BACKGROUND, (n, 1)))


class RaycastScene:
    """Moving rigid bodies that can be looked at.

    The acceleration structure is rebuilt for every cast from the bodies that can be seen: for a few thousand
    triangles this takes about a millisecond, less than one static structure per body costs in queries.
    """

    def __init__(self, bodies: Sequence[Body]) -> None:
        self._vertices = [np.asarray(body.vertices, np.float32) for body in bodies]
        self._faces = [np.asarray(body.faces, np.uint32) for body in bodies]
        self._colours = [np.asarray(body.face_colours, np.float32) for body in bodies]
        self._centres = np.array([(v.min(0) + v.max(0)) / 2 for v in self._vertices])
        self._radii = np.array(
            [np.linalg.norm(v - c, axis=1).max() for v, c in zip(self._vertices, self._centres, strict=True)]
        )

    def __len__(self) -> int:
        return len(self._vertices)

    def cast(self, rays: NDArray[np.float32], poses: Array, selection: Sequence[int] | None = None) -> RayHits:
        """Shoot rays at the bodies.

        Args:
            rays: (n, 6) origin and direction in the base frame.
            poses: (bodies, 4, 4) ``T_base_body``.
            selection: Bodies that exist for this cast; all by default.
        """
        chosen = range(len(self)) if selection is None else selection
        if not len(chosen):
            return RayHits.none(len(rays))
        T = poses.astype(np.float32)
        moved = [self._vertices[i] @ T[i, :3, :3].T + T[i, :3, 3] for i in chosen]
        offsets = np.cumsum([0] + [len(v) for v in moved])[:-1]
        faces = np.concatenate([self._faces[i] + np.uint32(o) for i, o in zip(chosen, offsets, strict=True)])
        scene = o3d.t.geometry.RaycastingScene(nthreads=1)
        scene.add_triangles(o3d.core.Tensor(np.concatenate(moved)), o3d.core.Tensor(faces))
        answer = scene.cast_rays(o3d.core.Tensor(rays), nthreads=1)
        distance = answer["t_hit"].numpy()
        hit = np.isfinite(distance)
        triangle = np.where(hit, answer["primitive_ids"].numpy(), 0)
        body_of_triangle = np.repeat(np.fromiter(chosen, int), [len(self._faces[i]) for i in chosen])
        colour_of_triangle = np.concatenate([self._colours[i] for i in chosen])
        return RayHits(
            distance=distance,
            body=np.where(hit, body_of_triangle[triangle], -1),
            normals=answer["primitive_normals"].numpy(),
            colours=np.where(hit[:, None], colour_of_triangle[triangle], BACKGROUND),
        )

    def capture(self, camera: PinholeCamera, poses: Array) -> DepthImage:
        """Take a picture; bodies outside the view cone are left out of the rebuild."""
        hits = self.cast(camera.rays_base, poses, self._visible(camera, poses))
        shape = (camera.height_px, camera.width_px)
        return DepthImage(hits.distance.reshape(shape), hits.colours.reshape(*shape, 3))

    def _visible(self, camera: PinholeCamera, poses: Array) -> list[int]:
        """Bodies whose bounding sphere meets the cone around the picture."""
        centres = np.einsum("bij,bj->bi", poses[:, :3, :3], self._centres) + poses[:, :3, 3]
        relative = centres - camera.T_base_cam[:3, 3]
        distance = np.linalg.norm(relative, axis=1)
        corner = camera.directions_cam[0, 0]
        half_angle = np.arctan(np.linalg.norm(corner[:2]))
        off_axis = np.arccos(np.clip(relative @ camera.T_base_cam[:3, 2] / np.maximum(distance, 1e-9), -1, 1))
        subtended = np.arcsin(np.clip(self._radii / np.maximum(distance, 1e-9), 0, 1))
        seen = (off_axis - subtended < half_angle) | (distance <= self._radii)
        return [int(i) for i in np.flatnonzero(seen)]
