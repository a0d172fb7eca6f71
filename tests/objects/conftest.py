from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
import trimesh

from tr_grasp.objects import shapes


def obj_text(parts: Sequence[trimesh.Trimesh]) -> str:
    """One ``o`` group for each part; indices run on through the file, as OBJ asks for."""
    lines, seen = [], 0
    for index, part in enumerate(parts):
        lines.append(f"o convex_{index}")
        lines += [f"v {x:.9f} {y:.9f} {z:.9f}" for x, y, z in part.vertices]
        lines += [f"f {a + seen + 1} {b + seen + 1} {c + seen + 1}" for a, b, c in part.faces]
        seen += len(part.vertices)
    return "\n".join(lines) + "\n"


@pytest.fixture
def write_obj() -> Callable[[Path, Sequence[trimesh.Trimesh]], Path]:
    def write(path: Path, parts: Sequence[trimesh.Trimesh]) -> Path:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(obj_text(parts))
        return path

    return write


@pytest.fixture
def write_object() -> Callable[..., Path]:
    """Write a good object folder: an L of two boxes, red unless said otherwise."""

    def write(folder: Path, scale: float = 1.0, colour: tuple[int, int, int] = (255, 0, 0)) -> Path:
        size, offset = 0.05 * scale, (0.02 * scale, 0.0, 0.035 * scale)
        parts = [shapes.box((size, size, 0.02 * scale)), shapes.box((0.02 * scale, size, size), offset)]
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "collision.obj").write_text(obj_text(parts))
        visual = trimesh.util.concatenate(parts)
        visual.visual.vertex_colors = [*colour, 255]
        visual.export(folder / "visual.ply")
        (folder / "meta.json").write_text("{}")
        return folder

    return write
