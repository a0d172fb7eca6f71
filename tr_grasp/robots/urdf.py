"""URDF text of a robot that is data."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING
from xml.sax.saxutils import quoteattr

from tr_grasp.files import cache_folder, write_atomically, write_once
from tr_grasp.robots.parts import JointSpec, LinkSpec, Shape

if TYPE_CHECKING:
    from tr_grasp.robots.spec import RobotSpec


def urdf_text(spec: RobotSpec) -> str:
    """The robot as URDF: boxes, cylinders, spheres, and meshes by absolute path; no ``<mimic>``."""
    lines = ['<?xml version="1.0"?>', f"<robot name={quoteattr(spec.name)}>"]
    for link in spec.links:
        lines += _link(link)
    for joint in spec.all_joints:
        lines += _joint(joint)
    return "\n".join([*lines, "</robot>", ""])


def write_urdf(spec: RobotSpec, folder: str | Path) -> Path:
    """Write :func:`urdf_text` to ``folder/<name>.urdf`` in one step.

    Raises:
        StorageError: It could not be written.
    """
    path = Path(folder) / f"{spec.name}.urdf"
    write_atomically(path, urdf_text(spec))
    return path


def cached_urdf(spec: RobotSpec) -> Path:
    """The robot's URDF in the user's cache folder, named after its content; written if it is not there yet.

    Raises:
        StorageError: It could not be written.
    """
    text = urdf_text(spec)
    name = f"{spec.name}-{hashlib.sha256(text.encode()).hexdigest()[:16]}.urdf"
    return write_once(cache_folder() / "robots" / name, lambda: text)


def _link(link: LinkSpec) -> Iterator[str]:
    yield f"<link name={quoteattr(link.name)}>"
    if link.mass_kg > 0:
        names = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
        inertia = " ".join(f'{name}="{value:.9g}"' for name, value in zip(names, link.inertia_kgm2, strict=True))
        yield f'<inertial>{_origin(link.com_m, link.com_rpy_rad)}<mass value="{link.mass_kg:.9g}"/>'
        yield f"<inertia {inertia}/></inertial>"
    for shape in link.shapes:
        body = f"{_origin(shape.xyz_m, shape.rpy_rad)}<geometry>{_geometry(shape)}</geometry>"
        if shape.drawn:
            colour = _numbers((*shape.colour, 1.0))
            material = f'<material name="{_material(shape)}"><color rgba="{colour}"/></material>'
            yield f"<visual>{body}{material}</visual>"
        if shape.collides:
            yield f"<collision>{body}</collision>"
    yield "</link>"


def _joint(joint: JointSpec) -> Iterator[str]:
    yield f'<joint name={quoteattr(joint.name)} type="{joint.kind}">{_origin(joint.xyz_m, joint.rpy_rad)}'
    yield f"<parent link={quoteattr(joint.parent)}/><child link={quoteattr(joint.child)}/>"
    if joint.kind != "fixed":
        yield f'<axis xyz="{_numbers(joint.axis)}"/>'
        limits = f'effort="{joint.effort:.12g}" velocity="{joint.velocity:.12g}"'
        if joint.kind != "continuous":
            limits = f'lower="{joint.lower:.12g}" upper="{joint.upper:.12g}" {limits}'
        yield f"<limit {limits}/>"
    yield "</joint>"


def _geometry(shape: Shape) -> str:
    if shape.kind == "box":
        return f'<box size="{_numbers(shape.size_m)}"/>'
    if shape.kind == "sphere":
        return f'<sphere radius="{shape.size_m[0]:.9g}"/>'
    if shape.kind == "cylinder":
        return f'<cylinder radius="{shape.size_m[0]:.9g}" length="{shape.size_m[1]:.9g}"/>'
    return f'<mesh filename={quoteattr(str(shape.mesh))} scale="{_numbers(shape.size_m)}"/>'


def _material(shape: Shape) -> str:
    return "rgb_" + "_".join(f"{round(255 * value):02x}" for value in shape.colour)


def _origin(xyz: Iterable[float], rpy: Iterable[float]) -> str:
    return f'<origin xyz="{_numbers(xyz)}" rpy="{_numbers(rpy)}"/>'


def _numbers(values: Iterable[float]) -> str:
    return " ".join(f"{value:.12g}" for value in values)
