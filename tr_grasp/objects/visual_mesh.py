"""Read the mesh that cameras see: light, coloured by face, with its outside outside."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from PIL import Image
from trimesh.visual import ColorVisuals, TextureVisuals

from tr_grasp.errors import MissingSystemLibraryError
from tr_grasp.objects.mesh_checks import UNSCALED, Scale, diagonal_of, require_few_faces, require_sane_vertices
from tr_grasp.objects.rejection import Reason, RejectedMesh

VISUAL_FACES_MAX = 2000
GREY = 0.6


def load_visual(
    path: Path, *, texture: Path | None = None, scale: Scale = UNSCALED
) -> tuple[trimesh.Trimesh, NDArray[np.float64]]:
    """A light, outward-facing mesh and ``(faces, 3)`` colours in [0, 1]; grey where the file has no colour.

    Visuals with a picture on few triangles are cut finer, so that it can be made out; those of more than
    ``VISUAL_FACES_MAX`` triangles are simplified.

    Args:
        path: A mesh file.
        texture: The picture to use where the file names one that is not beside it.
        scale: Factor along each axis that brings the file to metres.

    Raises:
        RejectedMesh: The file is missing, unreadable, empty, too large, not finite, or absurdly scaled.
    """
    if not path.is_file():
        raise RejectedMesh(Reason.MISSING_FILE, f"{path} is missing: without it cameras cannot see the object; add it.")
    require_few_faces(path)
    loaded = _read(path)
    vertices = np.asarray(loaded.vertices) * scale
    require_sane_vertices(path, vertices)
    if not 0 <= loaded.faces.min() <= loaded.faces.max() < len(vertices):
        raise RejectedMesh(
            Reason.UNREADABLE, f"{path} is corrupt: a face names a vertex that is not there; export it again."
        )
    loaded.vertices = vertices
    loaded = _finer(_with_texture(loaded, texture))
    colours = _vertex_colours(loaded)
    mesh, colours = _simplified(trimesh.Trimesh(loaded.vertices, loaded.faces, process=False), colours)
    if not mesh.is_winding_consistent or mesh.volume < 0:
        # Renumbers no face, so the colours below still fit.
        trimesh.repair.fix_normals(mesh, multibody=True)
    return mesh, colours[mesh.faces].mean(axis=1)


def _read(path: Path) -> trimesh.Trimesh:
    try:
        loaded = trimesh.load(path, force="mesh", process=False)
    except Exception as error:  # Every file format has errors of its own.
        raise RejectedMesh(Reason.UNREADABLE, f"cannot read {path}: {error}; export it again.") from error
    if not isinstance(loaded, trimesh.Trimesh) or len(loaded.faces) == 0:
        raise RejectedMesh(Reason.NO_FACES, f"{path} is empty: it has no faces; export the object's surface into it.")
    require_few_faces(path, len(loaded.faces))
    return loaded


def _with_texture(mesh: trimesh.Trimesh, texture: Path | None) -> trimesh.Trimesh:
    """The mesh with the picture of its own, if there is one, on its vertices."""
    visual = mesh.visual
    if isinstance(visual, TextureVisuals) and visual.uv is not None and texture is not None and texture.is_file():
        mesh.visual = TextureVisuals(visual.uv, image=_picture(texture))
    return mesh


def _finer(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """A mesh with a picture, cut into about as many triangles as are allowed: each of them has one colour."""
    visual = mesh.visual
    if not isinstance(visual, TextureVisuals) or visual.uv is None or not visual.defined:
        return mesh
    vertices, faces, uv = np.asarray(mesh.vertices), mesh.faces, {"uv": np.asarray(visual.uv)}
    while 4 * len(faces) <= VISUAL_FACES_MAX:
        cut: Any = trimesh.remesh.subdivide(vertices, faces, vertex_attributes=uv)
        vertices, faces, uv = cut
    return trimesh.Trimesh(vertices, faces, visual=TextureVisuals(uv["uv"], material=visual.material), process=False)


def _vertex_colours(mesh: trimesh.Trimesh) -> NDArray[np.float64]:
    """``(v, 3)`` colours in [0, 1] from vertex colours, face colours or a texture; grey if there is none."""
    visual = mesh.visual
    if isinstance(visual, TextureVisuals) and visual.defined:
        visual = visual.to_color()
    if not isinstance(visual, ColorVisuals) or not visual.defined:
        return np.full((len(mesh.vertices), 3), GREY)
    return np.asarray(visual.vertex_colors, dtype=np.float64)[:, :3] / 255


def _picture(path: Path) -> Image.Image:
    try:
        with Image.open(path) as picture:
            return picture.convert("RGB")
    except OSError as error:
        raise RejectedMesh(Reason.UNREADABLE, f"cannot read {path}: {error}; export it again.") from error


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
    full = full.merge_close_vertices(1e-6 * diagonal_of(np.asarray(mesh.vertices)))
    light = full.simplify_quadric_decimation(VISUAL_FACES_MAX)
    vertices, faces = np.asarray(light.vertices), np.asarray(light.triangles)
    return trimesh.Trimesh(vertices, faces, process=False), np.asarray(light.vertex_colors).clip(0, 1)
