"""A robot's URDF file as data, refused in one sentence where a simulator would fail late or in silence."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from tr_grasp.errors import ConfigError
from tr_grasp.robots.parts import Inertia, JointSpec, LinkSpec, Shape, Vector
from tr_grasp.robots.urdf_checks import check_tree

Element = ElementTree.Element
KINDS = ("revolute", "continuous", "prismatic", "fixed")
TURNS = 2 * np.pi
GREY = (0.7, 0.7, 0.72)


class UrdfFile:
    """Links and joints of a URDF file.

    Args:
        path: The file; meshes lie beside it or below, ``package://`` names are looked for in the folders above it too.
        mimic: What to do with ``<mimic>``: refuse it, or read the joint as one of its own.

    Raises:
        ConfigError: No such file, not URDF, a mesh that is missing, a joint that mimics another, links and joints that
            make no tree.
    """

    def __init__(self, path: str | Path, *, mimic: bool = False) -> None:
        self.path = Path(path)
        if not self.path.is_file():
            raise ConfigError(f"there is no URDF at '{self.path}'; give the path of an existing file.")
        try:
            root = ElementTree.parse(self.path).getroot()
        except ElementTree.ParseError as error:
            raise ConfigError(f"'{self.path}' is not XML: {error}.") from None
        if root.tag != "robot":
            raise ConfigError(f"'{self.path}' is not URDF: it starts with <{root.tag}>, not with <robot>.")
        self._palette = {m.get("name", ""): _colour(m) for m in root.findall("material") if _colour(m)}
        try:
            self.joints = tuple(self._joint(joint, mimic) for joint in root.findall("joint"))
            self.links = tuple(self._link(link) for link in root.findall("link"))
        except ConfigError:
            raise
        except ValueError as error:
            raise ConfigError(f"'{self.path}' has something else where numbers belong: {error}.") from None
        check_tree([link.name for link in self.links], self.joints, self.path)

    def _joint(self, joint: Element, mimic: bool) -> JointSpec:
        name = joint.get("name", "")
        kind: Any = joint.get("type", "")
        if kind not in KINDS:
            raise ConfigError(f"joint '{name}' of '{self.path}' is of type {kind!r}; valid: {', '.join(KINDS)}.")
        if not mimic and joint.find("mimic") is not None:
            raise ConfigError(
                f"joint '{name}' of '{self.path}' mimics another; remove its <mimic> and list it among the gripper's "
                "joints, which the controller couples."
            )
        limit, axis = joint.find("limit"), joint.find("axis")
        lower, upper = (-TURNS, TURNS) if kind == "continuous" else (self._number(limit, k) for k in ("lower", "upper"))
        direction = np.array(_floats(axis, "xyz", "1 0 0"))
        length = float(np.linalg.norm(direction))
        if length == 0 and kind != "fixed":
            raise ConfigError(f"joint '{name}' of '{self.path}' has an axis of length 0; give it one to move along.")
        direction = direction / max(length, 1e-12)
        return JointSpec(
            name=name,
            parent=_attribute(joint.find("parent"), "link"),
            child=_attribute(joint.find("child"), "link"),
            kind=kind,
            xyz_m=_floats(joint.find("origin"), "xyz"),
            rpy_rad=_floats(joint.find("origin"), "rpy"),
            axis=(float(direction[0]), float(direction[1]), float(direction[2])),
            lower=lower,
            upper=upper,
            velocity=self._number(limit, "velocity"),
            effort=self._number(limit, "effort"),
        )

    @staticmethod
    def _number(element: Element | None, name: str) -> float:
        return _finite((element.get(name) if element is not None else None) or "0")

    def _link(self, link: Element) -> LinkSpec:
        shapes = [self._shape(body, "collision") for body in link.findall("collision")]
        shapes += [self._shape(body, "visual") for body in link.findall("visual")]
        inertial = link.find("inertial")
        name = link.get("name", "")
        if inertial is None:
            return LinkSpec(name, shapes=tuple(shapes))
        mass, inertia = inertial.find("mass"), inertial.find("inertia")
        return LinkSpec(
            name,
            self._number(mass, "value"),
            _floats(inertial.find("origin"), "xyz"),
            _inertia(inertia),
            tuple(shapes),
            _floats(inertial.find("origin"), "rpy"),
        )

    def _shape(self, body: Element, role: str) -> Shape:
        geometry = body.find("geometry")
        solid = geometry[0] if geometry is not None and len(geometry) else Element("nothing")
        kind: Any = solid.tag
        sizes = {
            "box": lambda: _floats(solid, "size"),
            "cylinder": lambda: (self._number(solid, "radius"), self._number(solid, "length")),
            "sphere": lambda: (self._number(solid, "radius"),),
            "mesh": lambda: _floats(solid, "scale", "1 1 1"),
        }
        if kind not in sizes:
            raise ConfigError(f"'{self.path}' has a <{kind}> as {role} shape; valid: {', '.join(sizes)}.")
        return Shape(
            kind=kind,
            size_m=sizes[kind](),
            xyz_m=_floats(body.find("origin"), "xyz"),
            rpy_rad=_floats(body.find("origin"), "rpy"),
            colour=self._colour_of(body),
            collides=role == "collision",
            drawn=role == "visual",
            mesh=self._mesh(solid.get("filename", "")) if kind == "mesh" else None,
        )

    def _colour_of(self, body: Element) -> Vector:
        material = body.find("material")
        if material is None:
            return GREY
        return _colour(material) or self._palette.get(material.get("name", "")) or GREY

    def _mesh(self, name: str) -> Path:
        """A mesh beside the file; ``package://`` names are searched in all folders above it."""
        folder = self.path.resolve().parent
        plain = name.removeprefix("package://").removeprefix("file://")
        folders = [folder, *folder.parents] if name.startswith("package://") else [folder]
        for place in folders:
            if (place / plain).is_file():
                return place / plain
        raise ConfigError(f"'{self.path}' names the mesh '{name}', which is not there; put it at '{folder / plain}'.")


def _attribute(element: Element | None, name: str) -> str:
    return (element.get(name) if element is not None else None) or ""


def _floats(element: Element | None, name: str, default: str = "0 0 0") -> Vector:
    x, y, z = (_finite(text) for text in (_attribute(element, name) or default).split())
    return x, y, z


def _finite(text: str) -> float:
    value = float(text)
    if not np.isfinite(value):
        raise ValueError(f"'{text}' is not finite")
    return value


def _inertia(element: Element | None) -> Inertia:
    xx, yy, zz, xy, xz, yz = (
        _finite(_attribute(element, name) or "0") for name in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    )
    return xx, yy, zz, xy, xz, yz


def _colour(material: Element) -> Vector | None:
    text = _attribute(material.find("color"), "rgba").split()
    return (float(text[0]), float(text[1]), float(text[2])) if text else None
