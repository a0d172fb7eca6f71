"""Read one object from a folder of meshes and make sure that it can be simulated and seen."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial import QhullError
from trimesh.visual import ColorVisuals, TextureVisuals

from tr_grasp.errors import MeshError, MissingSystemLibraryError
from tr_grasp.objects.model import MAX_PART_VERTICES, ObjectModel, distance_outside, volume_and_centre
from tr_grasp.objects.obj_groups import read_groups

COLLISION_FILE = "collision.obj"
VISUAL_FILES = ("visual.ply", "visual.obj")
VISUAL_FACES_MAX = 2000

DIAGONAL_LIMITS_M = (1e-3, 10.0)
"""Bounding-box diagonals outside this range mean a file in other units than metres."""

HULL_VOLUME_SHARE = 0.9
"""A part that fills less of its convex hull is not convex, or has too large a hole."""

FLATNESS = 1e-5
"""A part that is thinner than this share of its length has no volume to simulate."""

FLAT_GAP_SHARE = 0.02
"""A part without volume may be left out if it is this near to others, as a share of the object's diagonal."""

GREY = 0.6


def load_object(folder: Path) -> ObjectModel:
    """The object of a folder at its own scale.

    The folder holds ``collision.obj`` (one group for each convex part) and ``visual.ply`` or ``visual.obj``, all in
    metres and one frame. Parts are replaced by their convex hulls, visuals of more than ``VISUAL_FACES_MAX``
    triangles are simplified.

    Raises:
        MeshError: If a file is missing, unreadable, empty, not finite, absurdly scaled, or a part is flat, open or
            not convex; the message names the file and what to do.
    """
    parts = load_parts(folder / COLLISION_FILE)
    visual, colours = load_visual(_visual_path(folder))
    _require_same_size(folder, parts, visual)
    return ObjectModel.assemble(folder.name, folder.name, parts, visual, colours)


def load_parts(path: Path) -> list[trimesh.Trimesh]:
    """Convex, closed, outward-facing parts of at most ``MAX_PART_VERTICES`` vertices from an OBJ file.

    Decompositions leave flat slivers on the faces of other parts; those are left out. Any other part without volume
    is an error.

    Raises:
        MeshError: See ``load_object``.
    """
    _require_file(path)
    groups = read_groups(path)
    all_vertices = np.concatenate([vertices for vertices, _ in groups])
    _require_sane_vertices(path, all_vertices)
    found = [_convex_part(f"part {index} of {path}", *group) for index, group in enumerate(groups)]
    parts = [part for part in found if part is not None]
    for index, (part, (vertices, _)) in enumerate(zip(found, groups, strict=True)):
        if part is None and _gap(vertices, parts) > FLAT_GAP_SHARE * _diagonal(all_vertices):
            raise MeshError(f"part {index} of {path} is degenerate: it has no volume; remove it, or give it thickness.")
    return parts


def load_visual(path: Path) -> tuple[trimesh.Trimesh, NDArray[np.float64]]:
    """A light, outward-facing mesh and ``(faces, 3)`` colours in [0, 1]; grey where the file has no colour.

    Raises:
        MeshError: See ``load_object``.
    """
    _require_file(path)
    try:
        loaded = trimesh.load(path, force="mesh", process=False)
    except Exception as error:  # Every file format has errors of its own.
        raise MeshError(f"cannot read {path}: {error}; export it again.") from error
    if not isinstance(loaded, trimesh.Trimesh) or len(loaded.faces) == 0:
        raise MeshError(f"{path} is empty: it has no faces; export the object's surface into it.")
    _require_sane_vertices(path, np.asarray(loaded.vertices))
    if not 0 <= loaded.faces.min() <= loaded.faces.max() < len(loaded.vertices):
        raise MeshError(f"{path} is corrupt: a face names a vertex that is not there; export it again.")
    mesh, colours = _simplified(trimesh.Trimesh(loaded.vertices, loaded.faces, process=False), _vertex_colours(loaded))
    if not mesh.is_winding_consistent or mesh.volume < 0:
        # Renumbers no face, so the colours below still fit.
        trimesh.repair.fix_normals(mesh, multibody=True)
    return mesh, colours[mesh.faces].mean(axis=1)


def _visual_path(folder: Path) -> Path:
    """The first visual file that exists; if none does, the first name, so that the error names it."""
    candidates = [folder / name for name in VISUAL_FILES]
    return next((path for path in candidates if path.is_file()), candidates[0])


def _require_file(path: Path) -> None:
    if not path.is_file():
        raise MeshError(f"{path} is missing: an object folder needs {COLLISION_FILE} and {VISUAL_FILES[0]}; add it.")


def _require_sane_vertices(path: Path, vertices: NDArray[np.float64]) -> None:
    if not np.isfinite(vertices).all():
        raise MeshError(f"{path} has a vertex that is NaN or infinite; remove it and export the file again.")
    diagonal = _diagonal(vertices)
    low, high = DIAGONAL_LIMITS_M
    if not low <= diagonal <= high:
        raise MeshError(
            f"{path} is {diagonal:.3g} m across, outside {low:g} to {high:g} m;"
            " convert it to metres and export it again."
        )


def _require_same_size(folder: Path, parts: list[trimesh.Trimesh], visual: trimesh.Trimesh) -> None:
    collision = _diagonal(np.concatenate([part.vertices for part in parts]))
    ratio = collision / _diagonal(np.asarray(visual.vertices))
    if not 0.5 <= ratio <= 2:
        raise MeshError(
            f"in {folder}, {COLLISION_FILE} is {ratio:.3g} times as large as the visual mesh;"
            " bring both to the same unit."
        )


def _diagonal(vertices: NDArray[np.float64]) -> float:
    return float(np.linalg.norm(np.ptp(vertices, axis=0)))


def _convex_part(what: str, vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> trimesh.Trimesh | None:
    """The hull of a part that is convex up to small gaps and dents; none for a part without volume."""
    hull = _hull(vertices)
    if hull is None:
        return None
    share = _filled_volume(vertices, faces, hull) / hull.volume
    if share < HULL_VOLUME_SHARE:
        raise MeshError(
            f"{what} fills {share:.0%} of its convex hull, less than {HULL_VOLUME_SHARE:.0%}: it is open or not convex;"
            " close it, or split it into convex parts."
        )
    return hull if len(hull.vertices) <= MAX_PART_VERTICES else _hull(_outermost(np.asarray(hull.vertices)))


def _hull(vertices: NDArray[np.float64]) -> trimesh.Trimesh | None:
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
    """The vertices that are farthest in evenly spread directions (a Fibonacci sphere), one for each."""
    turn = np.arange(MAX_PART_VERTICES) * np.pi * (3 - np.sqrt(5))
    z = 1 - (2 * np.arange(MAX_PART_VERTICES) + 1) / MAX_PART_VERTICES
    directions = np.column_stack([np.cos(turn) * np.sqrt(1 - z**2), np.sin(turn) * np.sqrt(1 - z**2), z])
    # In units of the extents, or a flat part would keep too few of its outline.
    spread = (vertices - vertices.mean(axis=0)) / np.ptp(vertices, axis=0)
    return vertices[np.unique((spread @ directions.T).argmax(axis=0))]


def _vertex_colours(mesh: trimesh.Trimesh) -> NDArray[np.float64]:
    """``(v, 3)`` colours in [0, 1] from vertex colours, face colours or a texture; grey if there is none."""
    visual = mesh.visual
    if isinstance(visual, TextureVisuals) and visual.defined:
        visual = visual.to_color()
    if not isinstance(visual, ColorVisuals) or not visual.defined:
        return np.full((len(mesh.vertices), 3), GREY)
    return np.asarray(visual.vertex_colors, dtype=np.float64)[:, :3] / 255


def _simplified(mesh: trimesh.Trimesh, colours: NDArray[np.float64]) -> tuple[trimesh.Trimesh, NDArray[np.float64]]:
    """At most ``VISUAL_FACES_MAX`` triangles, with the colours of the vertices that were merged."""
    if len(mesh.faces) <= VISUAL_FACES_MAX:
        return mesh, colours
    try:
        import open3d  # Slow to import, and only large meshes need it.
    except (ImportError, OSError) as error:
        raise MissingSystemLibraryError(
            f"a mesh of {len(mesh.faces)} triangles has to be simplified by Open3D, which does not load ({error});"
            f" run `tr-grasp doctor` for the cure, or simplify it to {VISUAL_FACES_MAX} triangles."
        ) from error

    full = open3d.geometry.TriangleMesh(
        open3d.utility.Vector3dVector(mesh.vertices), open3d.utility.Vector3iVector(mesh.faces.astype(np.int32))
    )
    full.vertex_colors = open3d.utility.Vector3dVector(colours)
    full = full.merge_close_vertices(1e-6 * _diagonal(np.asarray(mesh.vertices)))
    light = full.simplify_quadric_decimation(VISUAL_FACES_MAX)
    vertices, faces = np.asarray(light.vertices), np.asarray(light.triangles)
    return trimesh.Trimesh(vertices, faces, process=False), np.asarray(light.vertex_colors).clip(0, 1)
