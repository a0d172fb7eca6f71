"""The five household objects of Task II, upright: from a folder of YCB meshes, or as plain solids of the same size.

Sizes and masses: YCB object set (Calli et al. 2015, doi:10.1109/ICAR.2015.7251504).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray

from tr_grasp.errors import ConfigError, unknown_name
from tr_grasp.objects import shapes
from tr_grasp.objects.layouts import objects_in
from tr_grasp.objects.meshes import load_files
from tr_grasp.objects.model import ObjectModel

Array = NDArray[np.floating]
Groups = list[tuple[list[trimesh.Trimesh], tuple[float, float, float]]]

CORNER_SIDES = 4
LYING_IN_FILES = {"035_power_drill": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])}
"""``R_upright_file`` of what lies on its side in YCB's own frame: the drill stands on its battery."""


@dataclass(frozen=True)
class ConveyorObject:
    """An object that rides the conveyor.

    Attributes:
        name: Its name in YCB.
        model: Shape, standing along z.
        mass_kg: Of the real object.
    """

    name: str
    model: ObjectModel
    mass_kg: float


def conveyor_names() -> tuple[str, ...]:
    """Names of the objects of Task II."""
    return tuple(_STAND_INS)


def conveyor_object(name: str, folder: str | Path | None = None) -> ConveyorObject:
    """An object of Task II by its YCB name, ``006_mustard_bottle``.

    Args:
        name: One of :func:`conveyor_names`.
        folder: Of YCB meshes, one sub-folder for each object (see ``MeshSet``); without it, a plain stand-in.

    Raises:
        ConfigError: No such object, or no such folder, or the folder lacks it.
        MeshError: Its files cannot be used.
    """
    if name not in _STAND_INS:
        raise ConfigError(unknown_name("conveyor object", name, _STAND_INS))
    mass_kg, build = _STAND_INS[name]
    model = _assembled(name, build()) if folder is None else _from_folder(name, Path(folder).expanduser())
    return ConveyorObject(name, model, mass_kg)


def conveyor_objects(folder: str | Path | None = None) -> tuple[ConveyorObject, ...]:
    """All five, in the order of :func:`conveyor_names`; arguments and errors of :func:`conveyor_object`."""
    return tuple(conveyor_object(name, folder) for name in conveyor_names())


def _from_folder(name: str, folder: Path) -> ObjectModel:
    if not folder.is_dir():
        raise ConfigError(f"the folder of YCB objects {folder} does not exist; name one that does, or none.")
    files = {found.name: found for found in objects_in(folder)}
    if name not in files:
        raise ConfigError(f"{folder} has no {name!r}; Task II needs sub-folders {', '.join(_STAND_INS)}.")
    model = load_files(files[name])
    return _turned(model, LYING_IN_FILES[name]) if name in LYING_IN_FILES else model


def _turned(model: ObjectModel, R: Array) -> ObjectModel:
    def turned(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
        return trimesh.Trimesh(np.asarray(mesh.vertices) @ R.T, mesh.faces, process=False)

    parts = [turned(part) for part in model.parts]
    return ObjectModel.assemble(model.name, model.family, parts, turned(model.visual), model.face_colours)


def _assembled(name: str, groups: Groups) -> ObjectModel:
    parts = [part for group, _ in groups for part in group]
    offsets = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    faces = np.concatenate([part.faces + offset for part, offset in zip(parts, offsets, strict=True)])
    visual = trimesh.Trimesh(np.concatenate([part.vertices for part in parts]), faces, process=False)
    colours = np.concatenate([np.tile(colour, (len(part.faces), 1)) for group, colour in groups for part in group])
    return ObjectModel.assemble(name, name, parts, visual, colours)


def _outline(x_m: float, y_m: float, z_m: float, round_m: float) -> Array:
    """(n, 3) a rectangle with round corners at a height, counter-clockwise."""
    turn = np.linspace(0.0, np.pi / 2, CORNER_SIDES)
    centre = np.array([x_m / 2 - round_m, y_m / 2 - round_m])
    corner = round_m * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    quarters = []
    for k, signs in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1))):
        c, s = np.cos(k * np.pi / 2), np.sin(k * np.pi / 2)
        quarters.append(corner @ np.array([[c, s], [-s, c]]) + centre * signs)
    outline = np.concatenate(quarters)
    return np.column_stack([outline, np.full(len(outline), z_m)])


def _bleach() -> Groups:
    body = shapes.loft([_outline(0.1024, 0.0677, z, 0.022) for z in (0.0, 0.165)])
    shoulder = shapes.loft([_outline(0.1024, 0.0677, 0.165, 0.022), _outline(0.050, 0.045, 0.212, 0.018)])
    cap = shapes.cylinder(0.0200, 0.212, 0.2506)
    return [([body, shoulder], (0.93, 0.93, 0.90)), ([cap], (0.20, 0.40, 0.75))]


def _mustard() -> Groups:
    body = shapes.loft([_outline(0.0972, 0.0666, z, 0.028) for z in (0.0, 0.115)])
    shoulder = shapes.loft([_outline(0.0972, 0.0666, 0.115, 0.028), _outline(0.044, 0.044, 0.155, 0.018)])
    cap = shapes.revolved([(0.0190, 0.155), (0.0085, 0.1913)])
    return [([body, shoulder], (0.95, 0.78, 0.12)), ([cap], (0.85, 0.60, 0.08))]


def _potted_meat() -> Groups:
    return [([shapes.loft([_outline(0.1021, 0.0601, z, 0.018) for z in (0.0, 0.0835)])], (0.25, 0.35, 0.62))]


def _sugar() -> Groups:
    return [([shapes.box((0.0495, 0.0942, 0.176))], (0.93, 0.85, 0.30))]


def _drill() -> Groups:
    battery = shapes.box((0.105, 0.0573, 0.040), (0.0157, 0.0, 0.020))
    handle = shapes.moved(shapes.loft([_outline(0.050, 0.042, z, 0.012) for z in (0.040, 0.130)]), (0.030, 0.0, 0.0))
    motor = shapes.box((0.1201, 0.0500, 0.0575), (0.0320, 0.0, 0.15875))
    chuck = shapes.moved(shapes.lying(shapes.cylinder(0.0200, -0.0921, -0.02805)), (0.0, 0.0, 0.155))
    return [([battery, handle], (0.15, 0.15, 0.16)), ([motor], (0.90, 0.45, 0.10)), ([chuck], (0.30, 0.30, 0.32))]


_STAND_INS: dict[str, tuple[float, Callable[[], Groups]]] = {
    "021_bleach_cleanser": (1.131, _bleach),
    "006_mustard_bottle": (0.603, _mustard),
    "010_potted_meat_can": (0.370, _potted_meat),
    "004_sugar_box": (0.514, _sugar),
    "035_power_drill": (0.895, _drill),
}
"""Mass [kg] and the function that builds the stand-in."""
