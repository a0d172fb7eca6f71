"""Read the convex parts that physics simulates, and make them fit for it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial import QhullError

from tr_grasp.objects.mesh_checks import UNSCALED, Scale, diagonal_of, require_few_faces, require_sane_vertices
from tr_grasp.objects.model import MAX_PART_VERTICES, distance_outside, volume_and_centre
from tr_grasp.objects.obj_groups import read_groups
from tr_grasp.objects.rejection import Reason, RejectedMesh

HULL_VOLUME_SHARE = 0.9
"""A part that fills less of its convex hull is not convex, or has too large a hole."""

FLATNESS = 1e-5
"""A part that is thinner than this share of its length has no volume to simulate."""

FLAT_GAP_SHARE = 0.02
"""A part without volume may be left out if it is this near to others, as a share of the object's diagonal."""

Group = tuple[NDArray[np.float64], NDArray[np.int64]]


def load_parts(path: Path, *, scale: Scale = UNSCALED) -> list[trimesh.Trimesh]:
    """Convex, closed, outward-facing parts of at most ``MAX_PART_VERTICES`` vertices.

    An OBJ file has one group for each part, any other file one connected piece. Parts are replaced by their convex
    hulls. Decompositions leave flat slivers on the faces of other parts; those are left out. Any other part without
    volume is an error.

    Args:
        path: A mesh file.
        scale: Factor along each axis that brings the file to metres.

    Raises:
        RejectedMesh: The file is missing, unreadable, empty, too large, not finite or absurdly scaled, or a part is
            flat, open or not convex.
    """
    if not path.is_file():
        raise RejectedMesh(
            Reason.NO_COLLISION_MESH,
            f"{path} is missing: physics needs the convex parts of the object; add it, or lay the object out as"
            " meshes/model.obj, which is split into convex parts when it is read.",
        )
    require_few_faces(path)
    groups = [(vertices * scale, faces) for vertices, faces in _groups(path)]
    require_few_faces(path, sum(len(faces) for _, faces in groups))
    all_vertices = np.concatenate([vertices for vertices, _ in groups])
    require_sane_vertices(path, all_vertices)
    found = [_convex_part(f"part {index} of {path}", *group) for index, group in enumerate(groups)]
    parts = [part for part in found if part is not None]
    for index, (part, (vertices, _)) in enumerate(zip(found, groups, strict=True)):
        if part is None and _gap(vertices, parts) > FLAT_GAP_SHARE * diagonal_of(all_vertices):
            raise RejectedMesh(
                Reason.NO_VOLUME,
                f"part {index} of {path} is degenerate: it has no volume; remove it, or give it thickness.",
            )
    return parts


def _groups(path: Path) -> list[Group]:
    return read_groups(path) if path.suffix.lower() == ".obj" else _connected_pieces(path)


def _connected_pieces(path: Path) -> list[Group]:
    """Pieces of a mesh that share no vertex; vertices at one place are one only where pieces are open otherwise."""
    try:
        mesh = trimesh.load(path, force="mesh", process=False)
    except Exception as error:  # Every file format has errors of its own.
        raise RejectedMesh(Reason.UNREADABLE, f"cannot read {path}: {error}; export it again.") from error
    if not isinstance(mesh, trimesh.Trimesh) or len(mesh.faces) == 0:
        raise RejectedMesh(Reason.NO_FACES, f"{path} is empty: it has no faces; export the convex parts into it.")
    if not mesh.is_watertight:
        mesh.merge_vertices(merge_tex=True, merge_norm=True)
    piece_of_vertex = trimesh.graph.connected_component_labels(mesh.edges, node_count=len(mesh.vertices))
    piece_of_face = piece_of_vertex[mesh.faces[:, 0]]
    return [_only(mesh, piece_of_face == piece) for piece in np.unique(piece_of_face)]


def _only(mesh: trimesh.Trimesh, chosen: NDArray[np.bool_]) -> Group:
    used, renumbered = np.unique(mesh.faces[chosen], return_inverse=True)
    return np.asarray(mesh.vertices)[used], renumbered.reshape(-1, 3)


def _convex_part(what: str, vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> trimesh.Trimesh | None:
    """The hull of a part that is convex up to small gaps and dents; none for a part without volume."""
    hull = hull_of(vertices)
    if hull is None:
        return None
    share = _filled_volume(vertices, faces, hull) / hull.volume
    if share < HULL_VOLUME_SHARE:
        raise RejectedMesh(
            Reason.NOT_MANIFOLD,
            f"{what} fills {share:.0%} of its convex hull, less than {HULL_VOLUME_SHARE:.0%}: it is open or not convex;"
            " close it, or split it into convex parts.",
        )
    return hull if len(hull.vertices) <= MAX_PART_VERTICES else hull_of(_outermost(np.asarray(hull.vertices)))


def hull_of(vertices: NDArray[np.float64]) -> trimesh.Trimesh | None:
    """The convex hull of points ``(n, 3)``; none where they are flat."""
    spread = np.linalg.svd(vertices - vertices.mean(axis=0), compute_uv=False)
    if len(spread) < 3 or spread[2] < FLATNESS * spread[0]:
        return None
    try:
        return trimesh.convex.convex_hull(vertices)
    except QhullError:  # Its own idea of flat is a little stricter.
        return None


def _gap(points: NDArray[np.float64], parts: list[trimesh.Trimesh]) -> float:
    """How far the farthest of the points is from the nearest part [m]; infinite without parts."""
    distances = [distance_outside(part, points) for part in parts]
    return float(np.min(distances, axis=0).max()) if distances else np.inf


def _filled_volume(vertices: NDArray[np.float64], faces: NDArray[np.int64], hull: trimesh.Trimesh) -> float:
    """Volume between the faces and a point inside; missing faces count as missing volume."""
    part = trimesh.Trimesh(vertices, faces, process=False)
    part.merge_vertices()
    if not part.is_winding_consistent:
        trimesh.repair.fix_winding(part)
    _, inside = volume_and_centre(hull)
    part.vertices = part.vertices - inside
    corners = part.triangles
    return abs(float(np.einsum("fi,fi->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])))) / 6


def _outermost(vertices: NDArray[np.float64]) -> NDArray[np.float64]:
    """The vertices that are farthest along the axes, so that the extents stay, and in evenly spread directions."""
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    directions = np.concatenate([axes, _fibonacci_sphere(MAX_PART_VERTICES - len(axes))])
    # In units of the extents, or a flat part would keep too few of its outline.
    spread = (vertices - vertices.mean(axis=0)) / np.ptp(vertices, axis=0)
    return vertices[np.unique((spread @ directions.T).argmax(axis=0))]


def _fibonacci_sphere(count: int) -> NDArray[np.float64]:
    """``(count, 3)`` unit vectors, evenly spread."""
    turn = np.arange(count) * np.pi * (3 - np.sqrt(5))
    z = 1 - (2 * np.arange(count) + 1) / count
    return np.column_stack([np.cos(turn) * np.sqrt(1 - z**2), np.sin(turn) * np.sqrt(1 - z**2), z])
