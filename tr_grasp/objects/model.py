"""What is grasped: convex parts for physics, one coloured mesh for cameras, and the figures of both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

MAX_PART_VERTICES = 64
"""PhysX simulates hulls of up to this many vertices on CPU and GPU alike."""


@dataclass(frozen=True, eq=False)
class ObjectModel:
    """A rigid object in its own frame, whose origin is the centre of mass at uniform density.

    The frame's origin and all masses count overlaps of parts twice, as the physics engine does. Build one with
    :meth:`assemble`, which moves the origin there. Treat the meshes as read-only: sets share them.
    """

    name: str
    """Which object this is; the same for every copy and scale of it."""

    family: str
    """What kind it is; results are grouped by it."""

    parts: tuple[trimesh.Trimesh, ...]
    """Convex, closed, outward-facing hulls of at most ``MAX_PART_VERTICES`` vertices [m]."""

    visual: trimesh.Trimesh
    """Light mesh with outward faces that cameras see [m]."""

    face_colours: NDArray[np.float32]
    """``(faces, 3)`` red, green, blue in [0, 1], one row for each face of ``visual``."""

    @classmethod
    def assemble(
        cls,
        name: str,
        family: str,
        parts: Sequence[trimesh.Trimesh],
        visual: trimesh.Trimesh,
        face_colours: NDArray[Any],
    ) -> ObjectModel:
        """Take parts and visual in any common frame and move the origin to their centre of mass.

        Raises:
            ValueError: If there is no part, or not one colour for each visual face.
        """
        if not parts:
            raise ValueError(f"object {name!r} needs at least one part")
        if face_colours.shape != (len(visual.faces), 3):
            raise ValueError(f"face_colours of {name!r} must be {(len(visual.faces), 3)}, got {face_colours.shape}")
        volumes, centres = zip(*(volume_and_centre(part) for part in parts), strict=True)
        origin = np.average(centres, axis=0, weights=volumes)
        return cls(
            name=name,
            family=family,
            parts=tuple(_moved(part, 1.0, origin) for part in parts),
            visual=_moved(visual, 1.0, origin),
            face_colours=np.clip(face_colours, 0.0, 1.0).astype(np.float32),
        )

    @cached_property
    def volume_m3(self) -> float:
        """Sum of the parts' volumes [m^3]."""
        return float(sum(volume_and_centre(part)[0] for part in self.parts))

    @cached_property
    def bounds_m(self) -> NDArray[np.float64]:
        """``(2, 3)`` lowest and highest corner of the parts' bounding box [m]."""
        corners = np.concatenate([part.vertices for part in self.parts])
        return np.stack([corners.min(axis=0), corners.max(axis=0)])

    @property
    def extents_m(self) -> NDArray[np.float64]:
        """``(3,)`` edge lengths of the bounding box [m]."""
        return self.bounds_m[1] - self.bounds_m[0]

    @property
    def diagonal_m(self) -> float:
        """Diagonal of the bounding box [m]."""
        return float(np.linalg.norm(self.extents_m))

    @cached_property
    def surface_area_m2(self) -> float:
        """Area of the union of the parts [m^2], to about one per cent: walls between parts do not count."""
        return _exposed_area(self.parts)

    def inertia_kgm2(self, mass_kg: float) -> NDArray[np.float64]:
        """``(3, 3)`` inertia about the centre of mass, in the object's frame, at uniform density.

        Args:
            mass_kg: Mass of the whole object. Where it grows with the volume, inertia grows with the fifth power of
                the size.
        """
        second_moments = sum(_second_moments(part) for part in self.parts)
        return mass_kg / self.volume_m3 * (np.trace(second_moments) * np.eye(3) - second_moments)

    def scaled(self, factor: float) -> ObjectModel:
        """A copy ``factor`` times as large.

        Raises:
            ValueError: If ``factor`` is not positive and finite.
        """
        if not (np.isfinite(factor) and factor > 0):
            raise ValueError(f"factor must be positive and finite, got {factor}")
        origin = np.zeros(3)
        parts = tuple(_moved(part, factor, origin) for part in self.parts)
        return ObjectModel(self.name, self.family, parts, _moved(self.visual, factor, origin), self.face_colours)


def volume_and_centre(mesh: trimesh.Trimesh) -> tuple[float, NDArray[np.float64]]:
    """Volume [m^3] and centre of mass ``(3,)`` [m] of a closed, outward-facing mesh: a sum of signed tetrahedra."""
    reference = mesh.vertices.mean(axis=0)
    corners = np.asarray(mesh.vertices)[mesh.faces] - reference
    volumes = np.einsum("fi,fi->f", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    total = volumes.sum()
    if total == 0:
        return 0.0, reference
    return float(total), reference + (volumes[:, None] * corners.sum(axis=1)).sum(axis=0) / (4 * total)


def _second_moments(mesh: trimesh.Trimesh) -> NDArray[np.float64]:
    """``(3, 3)`` integral of ``x x^T`` over a closed, outward-facing mesh [m^5]: a sum of signed tetrahedra."""
    corners = np.asarray(mesh.vertices)[mesh.faces]
    volumes = np.einsum("fi,fi->f", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    sums = corners.sum(axis=1)
    products = np.einsum("fki,fkj->fij", corners, corners) + np.einsum("fi,fj->fij", sums, sums)
    return np.einsum("f,fij->ij", volumes, products) / 20


def distance_outside(part: trimesh.Trimesh, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far ``(*batch, 3)`` points are outside the planes of a convex part [m]; negative inside.

    Never more than the distance to the part, and equal to it wherever a face is what is nearest.
    """
    corners = part.triangles
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    return (points @ normals.T - np.einsum("fi,fi->f", normals, corners[:, 0])).max(axis=-1)


def _moved(mesh: trimesh.Trimesh, factor: float, origin: NDArray[np.float64]) -> trimesh.Trimesh:
    return trimesh.Trimesh((np.asarray(mesh.vertices) - origin) * factor, mesh.faces.copy(), process=False)


def _exposed_area(parts: Sequence[trimesh.Trimesh], splits: int = 8) -> float:
    """Sum the small triangles, ``splits**2`` to a face, whose outer side is in no other part."""
    triangles = np.concatenate([part.triangles for part in parts])
    owner = np.repeat(np.arange(len(parts)), [len(part.faces) for part in parts])
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    double_areas = np.linalg.norm(normals, axis=1)
    # A hair's breadth outside the face, so that the two sides of a shared wall each lie in the other part.
    step = 1e-5 * np.linalg.norm(np.ptp(triangles.reshape(-1, 3), axis=0))
    outside = step * normals / np.maximum(double_areas, 1e-30)[:, None]
    samples = np.einsum("sk,fkd->fsd", _barycentric_grid(splits), triangles) + outside[:, None]
    hidden = np.zeros(samples.shape[:2], dtype=bool)
    for index, part in enumerate(parts):
        others = owner != index
        hidden[others] |= distance_outside(part, samples[others]) < 0
    return float((double_areas / 2 * (~hidden).mean(axis=1)).sum())


def _barycentric_grid(splits: int) -> NDArray[np.float64]:
    """``(splits**2, 3)`` weights of the centres of the equal triangles that a triangle splits into."""
    upright = [(i + 1 / 3, j + 1 / 3) for i in range(splits) for j in range(splits - i)]
    inverted = [(i + 2 / 3, j + 2 / 3) for i in range(splits) for j in range(splits - i - 1)]
    first_two = np.array(upright + inverted) / splits
    return np.column_stack([first_two, 1 - first_two.sum(axis=1)])
