"""Split a mesh into convex parts with CoACD, once: the result is kept in a cache folder."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import trimesh

from tr_grasp.errors import MissingSystemLibraryError
from tr_grasp.files import cache_folder, write_once
from tr_grasp.objects.closing import closed_volume
from tr_grasp.objects.collision_parts import load_parts
from tr_grasp.objects.obj_groups import groups_text

SETTINGS = {"threshold": 0.05, "mcts_iterations": 60, "mcts_nodes": 10, "resolution": 1000, "seed": 0}
"""Of CoACD: its own concavity threshold, with a search that takes half the time and leaves as many parts."""


def convex_parts(mesh: trimesh.Trimesh, what: str, cache: Path | None = None) -> list[trimesh.Trimesh]:
    """Convex parts of a mesh, as ``collision_parts.load_parts`` gives them.

    The same mesh gives the same parts, whether they are made or come from the cache: they are stored under a hash of
    the mesh and of the settings, and always read from there.

    Args:
        mesh: An outward-facing mesh [m]. One of two thousand faces takes some seconds.
        what: What messages call it.
        cache: Where results are kept, by default ``convex_parts`` in :func:`~tr_grasp.files.cache_folder`.

    Raises:
        RejectedMesh: The mesh has no inside.
        MissingSystemLibraryError: CoACD is not installed.
        StorageError: The cache cannot be written.
    """
    volume = closed_volume(mesh, what)
    folder = cache or cache_folder() / "convex_parts"
    return load_parts(write_once(folder / f"{_key(volume)}.obj", lambda: _decomposed(volume, what)))


def _key(mesh: trimesh.Trimesh) -> str:
    content = hashlib.sha256(repr(sorted(SETTINGS.items())).encode())
    content.update(np.asarray(mesh.vertices, np.float64).tobytes())
    content.update(np.asarray(mesh.faces, np.int64).tobytes())
    return content.hexdigest()


def _decomposed(mesh: trimesh.Trimesh, what: str) -> str:
    """The text of an OBJ file with one group for each part."""
    try:
        # A process that loads CoACD before trimesh (which this file imports) can no longer load Open3D.
        import coacd
    except (ImportError, OSError) as error:
        raise MissingSystemLibraryError(
            f"{what} has no convex parts and CoACD, which makes them, cannot be loaded ({error});"
            " run `pip install 'tr-grasp[meshes]'`."
        ) from error
    coacd.set_log_level("error")
    # Its preparation would wrap the mesh, a millimetre or two thicker; a closed one needs none.
    parts = coacd.run_coacd(coacd.Mesh(mesh.vertices, mesh.faces), preprocess_mode="off", **SETTINGS)
    return groups_text(parts)
