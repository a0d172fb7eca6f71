"""Close a scanned surface, so that it has an inside."""

from __future__ import annotations

import numpy as np
import trimesh

from tr_grasp.objects.collision_parts import hull_of
from tr_grasp.objects.rejection import Reason, RejectedMesh

HOLE_AREA_SHARE = 0.2
"""Holes of more than this share of the surface are openings, as of a bowl; a lid on them would be another shape."""


def closed_volume(mesh: trimesh.Trimesh, what: str) -> trimesh.Trimesh:
    """A copy in which every edge joins two faces: vertices at one place are one, and small holes have lids.

    Args:
        mesh: An outward-facing mesh [m].
        what: What messages call it.

    Raises:
        RejectedMesh: The mesh is flat, has a large hole, or has edges of three faces and more.
    """
    mesh = mesh.copy()
    mesh.merge_vertices()
    mesh.update_faces(mesh.nondegenerate_faces() & mesh.unique_faces())
    if hull_of(np.asarray(mesh.vertices)) is None:
        raise RejectedMesh(Reason.NO_VOLUME, f"{what} is flat: it has no volume; give it thickness.")
    with_lids = _with_lids(mesh)
    holes = 1 - mesh.area / with_lids.area
    if holes > HOLE_AREA_SHARE:
        raise RejectedMesh(
            Reason.NOT_MANIFOLD,
            f"holes are {holes:.0%} of the surface of {what}, more than {HOLE_AREA_SHARE:.0%}; close them, or add the"
            " object's convex parts.",
        )
    if not with_lids.is_volume:
        raise RejectedMesh(
            Reason.NOT_MANIFOLD,
            f"{what} encloses no volume: some edges do not join exactly two faces; repair it (in Blender: 3D-Print"
            " Toolbox, Make Manifold), or add the object's convex parts.",
        )
    return with_lids


def _with_lids(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Every connected rim joined to its middle by a fan of faces."""
    _, edge, faces_n = np.unique(mesh.edges_sorted, axis=0, return_inverse=True, return_counts=True)
    rim = mesh.edges[faces_n[edge] == 1]
    hole_of_vertex = trimesh.graph.connected_component_labels(rim, node_count=len(mesh.vertices))
    holes, hole = np.unique(hole_of_vertex[rim[:, 0]], return_inverse=True)
    vertices = np.asarray(mesh.vertices)
    middles = [vertices[np.unique(rim[hole == index])].mean(axis=0) for index in range(len(holes))]
    lids = np.column_stack([rim[:, ::-1], len(vertices) + hole])
    return trimesh.Trimesh(
        np.concatenate([vertices, np.reshape(middles, (-1, 3))]), np.concatenate([mesh.faces, lids]), process=False
    )
