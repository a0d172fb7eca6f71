"""Read and write Wavefront OBJ files with one ``o`` or ``g`` group for each mesh; usual loaders may merge them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tr_grasp.objects.rejection import Reason, RejectedMesh


@dataclass
class _Reader:
    vertices: list[tuple[float, ...]] = field(default_factory=list)
    groups: list[list[tuple[int, int, int]]] = field(default_factory=list)

    def read(self, line: str) -> None:
        keyword, *values = line.split() or ["#"]
        if keyword == "v":
            x, y, z = (float(value) for value in values[:3])
            self.vertices.append((x, y, z))
        elif keyword in ("o", "g"):
            self.groups.append([])
        elif keyword == "f":
            self._add_polygon([self._index(value) for value in values])

    def _add_polygon(self, polygon: list[int]) -> None:
        if len(polygon) < 3:
            raise ValueError("a face needs three corners")
        if not self.groups:
            self.groups.append([])
        self.groups[-1] += [(polygon[0], b, c) for b, c in pairwise(polygon[1:])]

    def _index(self, value: str) -> int:
        """Zero-based vertex of ``7``, ``7/1/2`` or ``-1`` (counted back from the last one)."""
        number = int(value.split("/")[0])
        index = number - 1 if number > 0 else len(self.vertices) + number
        if number == 0 or not 0 <= index < len(self.vertices):
            raise ValueError(f"a face names vertex {number} of {len(self.vertices)}")
        return index


def read_groups(path: Path) -> list[tuple[NDArray[np.float64], NDArray[np.int64]]]:
    """Vertices ``(v, 3)`` and triangles ``(f, 3)`` of every group that has faces.

    A file without groups is one group. Materials, normals and texture coordinates are left out.

    Raises:
        RejectedMesh: If the file is no OBJ text or has no faces; the message names the line.
    """
    reader = _Reader()
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise RejectedMesh(
            Reason.UNREADABLE, f"cannot read {path}: {error}; export it again as a text OBJ file."
        ) from error
    for number, line in enumerate(lines, start=1):
        try:
            reader.read(line)
        except ValueError as error:
            raise RejectedMesh(
                Reason.UNREADABLE, f"{path}, line {number}, is not valid OBJ: {error}; export the file again."
            ) from error
    groups = [_compact(np.array(reader.vertices), np.array(faces)) for faces in reader.groups if faces]
    if not groups:
        raise RejectedMesh(
            Reason.NO_FACES, f"{path} is empty: it has no faces; export the convex parts of the object into it."
        )
    return groups


def groups_text(groups: Sequence[tuple[NDArray[np.floating], NDArray[np.integer]]]) -> str:
    """The text of an OBJ file from which :func:`read_groups` reads the same vertices and triangles, bit by bit."""
    lines, first = [], 1
    for index, (vertices, faces) in enumerate(groups):
        lines.append(f"o part_{index}")
        lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in np.asarray(vertices, float).tolist()]
        lines += [f"f {a} {b} {c}" for a, b, c in (np.asarray(faces) + first).tolist()]
        first += len(vertices)
    return "\n".join(lines) + "\n"


def _compact(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    used, renumbered = np.unique(faces, return_inverse=True)
    return vertices[used], renumbered.reshape(faces.shape)
