"""Read one object from its files and make sure that it can be simulated and seen."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import trimesh

from tr_grasp.objects.collision_parts import load_parts
from tr_grasp.objects.decomposition import convex_parts
from tr_grasp.objects.layouts import ObjectFiles, files_in
from tr_grasp.objects.mesh_checks import diagonal_of
from tr_grasp.objects.model import ObjectModel, volume_and_centre
from tr_grasp.objects.pieces import pieces_of
from tr_grasp.objects.rejection import Reason, RejectedMesh
from tr_grasp.objects.visual_mesh import load_visual

PIECE_GAP_SHARE = 0.05
"""Parts that are farther apart than this share of the object's diagonal do not hang together."""

LARGE_PIECE_SHARE = 0.1
"""A piece of less of the object's volume than this is a crumb; two larger ones are two objects (thesis)."""

INERTIA_RATIO_MIN = 1e-4
"""Least ratio of the smallest to the largest moment of inertia; a wire has less."""


def load_object(folder: Path) -> ObjectModel:
    """The object of a folder at its own scale; errors as in :func:`load_files`.

    The folder holds ``collision.obj`` (one group for each convex part) and ``visual.ply`` or ``visual.obj``, all in
    metres and one frame, or ``meshes/model.obj`` as in Google Scanned Objects.
    """
    return load_files(files_in(folder))


def load_files(files: ObjectFiles) -> ObjectModel:
    """The object of some files at its own scale.

    Raises:
        RejectedMesh: A file is missing, unreadable, empty, too large, not finite or absurdly scaled; a part is flat,
            open or not convex; or the object is a wire or several objects. The message names the file and what to do.
        MissingSystemLibraryError: A library that this object needs is not there.
    """
    scale = files.scale_to_metres()
    parts = None if files.collision is None else load_parts(files.collision, scale=scale)
    visual, colours = load_visual(files.visual, texture=files.texture, scale=scale)
    parts = convex_parts(visual, str(files.visual)) if parts is None else parts
    _require_same_size(files, parts, visual)
    _require_one_piece(files, parts)
    model = ObjectModel.assemble(files.name, files.name, parts, visual, colours)
    _require_inertia(files, model)
    return model


def _require_same_size(files: ObjectFiles, parts: Sequence[trimesh.Trimesh], visual: trimesh.Trimesh) -> None:
    collision = diagonal_of(np.concatenate([part.vertices for part in parts]))
    ratio = collision / diagonal_of(np.asarray(visual.vertices))
    if not 0.5 <= ratio <= 2:
        name = "the collision mesh" if files.collision is None else files.collision.name
        raise RejectedMesh(
            Reason.WRONG_UNITS,
            f"in {files.folder}, {name} is {ratio:.3g} times as large as the visual mesh; bring both to the same unit.",
        )


def _require_one_piece(files: ObjectFiles, parts: Sequence[trimesh.Trimesh]) -> None:
    gap_m = PIECE_GAP_SHARE * diagonal_of(np.concatenate([part.vertices for part in parts]))
    volumes = np.array([volume_and_centre(part)[0] for part in parts])
    shares = [volumes[piece].sum() / volumes.sum() for piece in pieces_of(parts, gap_m)]
    large_n = sum(share > LARGE_PIECE_SHARE for share in shares)
    if large_n > 1:
        raise RejectedMesh(
            Reason.SEVERAL_PIECES,
            f"{files.folder} falls into {large_n} large pieces with more than {1e3 * gap_m:.1f} mm between them;"
            " make each an object of its own.",
        )


def _require_inertia(files: ObjectFiles, model: ObjectModel) -> None:
    moments = np.linalg.eigvalsh(model.inertia_kgm2(1.0))
    if not moments[0] > INERTIA_RATIO_MIN * moments[-1]:
        raise RejectedMesh(
            Reason.DEGENERATE_INERTIA,
            f"{files.folder} is as thin as a wire: its moments of inertia differ by a factor of"
            f" {moments[-1] / max(moments[0], 1e-30):.2g}, more than {1 / INERTIA_RATIO_MIN:.0g}; make it thicker.",
        )
