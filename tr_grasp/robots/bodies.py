"""What the links of a robot look like, as coloured triangles."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import trimesh

from tr_grasp.errors import ConfigError
from tr_grasp.robots.chain import origin_transform
from tr_grasp.robots.parts import Array, LinkSpec, Shape
from tr_grasp.robots.spec import RobotSpec
from tr_grasp.sensing import Body

SIDES = 32


def robot_bodies(spec: RobotSpec) -> dict[str, Body]:
    """Each link that can be seen, in its own frame.

    Raises:
        ConfigError: A mesh that cannot be read or is empty.
    """
    return {link.name: link_body(link) for link in spec.links if any(shape.drawn for shape in link.shapes)}


def link_body(link: LinkSpec) -> Body:
    """What is drawn of a link, as one mesh."""
    parts = [part for shape in link.shapes if shape.drawn for part in _parts(shape)]
    offsets = np.cumsum([0] + [len(mesh.vertices) for mesh, _ in parts[:-1]])
    return Body(
        vertices=np.concatenate([mesh.vertices for mesh, _ in parts]),
        faces=np.concatenate([mesh.faces + offset for (mesh, _), offset in zip(parts, offsets, strict=True)]),
        face_colours=np.concatenate([np.broadcast_to(colour, (len(mesh.faces), 3)) for mesh, colour in parts]),
    )


def _parts(shape: Shape) -> Iterator[tuple[trimesh.Trimesh, Array]]:
    """Meshes of one colour (3,)."""
    T, size, colour = origin_transform(shape.xyz_m, shape.rpy_rad), shape.size_m, np.asarray(shape.colour)
    if shape.mesh is not None:
        for part in _triangles(shape.mesh):
            part.apply_transform(T @ np.diag([*size, 1.0]))
            material = getattr(part.visual, "material", None)
            yield part, colour if material is None else np.asarray(material.main_color)[:3] / 255.0
        return
    if shape.kind == "box":
        mesh = trimesh.creation.box(size)
    elif shape.kind == "cylinder":
        mesh = trimesh.creation.cylinder(radius=size[0], height=size[1], sections=SIDES)
    else:
        mesh = trimesh.creation.uv_sphere(radius=size[0], count=(SIDES // 2, SIDES))
    mesh.apply_transform(T)
    yield mesh, colour


def _triangles(path: Path) -> list[trimesh.Trimesh]:
    try:
        parts = trimesh.load_scene(path).dump()
    except Exception as error:  # Every file format has errors of its own.
        raise ConfigError(f"cannot read the robot's mesh '{path}': {error}; export it again.") from error
    meshes = [part for part in parts if isinstance(part, trimesh.Trimesh) and len(part.faces)]
    if not meshes:
        raise ConfigError(f"the robot's mesh '{path}' has no triangles; export it again.")
    return meshes
