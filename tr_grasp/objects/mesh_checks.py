"""What every mesh file must be before anything is made of it: there, small, finite and in metres."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tr_grasp.objects.rejection import Reason, RejectedMesh

FACES_MAX = 40_000
"""Meshes of more triangles are left out. Source: the thesis' rule for scanned objects."""

DIAGONAL_LIMITS_M = (1e-3, 10.0)
"""Bounding-box diagonals outside this range mean a file in other units than metres."""

Scale = tuple[float, float, float]
UNSCALED: Scale = (1.0, 1.0, 1.0)


def require_few_faces(path: Path, faces_n: int | None = None) -> None:
    """Refuse a mesh of more than ``FACES_MAX`` triangles.

    Args:
        path: The file, named in the message.
        faces_n: How many it has; by default what its text or header tells without reading the mesh, which for a huge
            file takes long.

    Raises:
        RejectedMesh: It has too many.
    """
    found = announced_faces(path) if faces_n is None else faces_n
    if found > FACES_MAX:
        raise RejectedMesh(
            Reason.TOO_MANY_FACES,
            f"{path} has {found:,} triangles, more than the {FACES_MAX:,} that an object may have;"
            " simplify it (in Blender: Decimate) and export it again.",
        )


def announced_faces(path: Path) -> int:
    """Faces that an OBJ file lists or the header of a PLY file promises; 0 where neither says so."""
    content = path.read_bytes()
    if path.suffix.lower() == ".obj":
        return content.count(b"\nf ") + content.startswith(b"f ")
    header, found, _ = content.partition(b"end_header")
    counts = [line.split()[-1] for line in header.splitlines() if line.startswith(b"element face ")]
    return int(counts[0]) if found and counts and counts[0].isdigit() else 0


def require_sane_vertices(path: Path, vertices: NDArray[np.floating]) -> None:
    """Refuse vertices ``(v, 3)`` [m] that are not finite, or as far apart as only other units explain.

    Raises:
        RejectedMesh: They are; the message names the file.
    """
    if not np.isfinite(vertices).all():
        raise RejectedMesh(
            Reason.NOT_FINITE, f"{path} has a vertex that is NaN or infinite; remove it and export the file again."
        )
    size = diagonal_of(vertices)
    low, high = DIAGONAL_LIMITS_M
    if not low <= size <= high:
        raise RejectedMesh(
            Reason.WRONG_UNITS,
            f"{path} is {size:.3g} m across, outside {low:g} to {high:g} m; convert it to metres and export it again.",
        )


def diagonal_of(vertices: NDArray[np.floating]) -> float:
    """Diagonal [m] of the bounding box of points ``(v, 3)``."""
    return float(np.linalg.norm(np.ptp(vertices, axis=0)))
