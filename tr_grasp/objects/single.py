"""One object by itself: by its name in Task II, from a folder, or from a mesh file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tr_grasp.errors import ConfigError, MeshError, unknown_name
from tr_grasp.objects.bottle import bottle
from tr_grasp.objects.conveyor import ConveyorObject, conveyor_names, conveyor_object
from tr_grasp.objects.layouts import ObjectFiles, files_in
from tr_grasp.objects.meshes import load_files

BOTTLE, BOTTLE_SIZE_M, BOTTLE_KG = "bottle", (0.03, 0.24), 0.2
"""Radius and height of the bottle that pick and place carries."""
DENSITY_KGM3 = 600.0
"""Of an object whose mass nobody said: household objects float, most of them."""


def single_object(source: str, *, scale: float = 1.0, mass_kg: float | None = None) -> ConveyorObject:
    """An object with its mass.

    Args:
        source: A name of :func:`~tr_grasp.objects.conveyor_names`, ``bottle`` (that of pick and place), the path of an
            object's folder (see ``MeshSet``), or that of a mesh file in metres, which is split into convex parts.
        scale: Factor on its size; the mass grows with the volume where it is not given.
        mass_kg: Its mass; by default that of the object of Task II, or its volume at 600 kg/m³.

    Raises:
        ConfigError: No such object or file, or a scale or mass that is not positive.
        MeshError: A mesh that encloses no volume, is not finite, in other units than metres, or falls to pieces.
    """
    for name, value in (("scale", scale), ("mass_kg", 1.0 if mass_kg is None else mass_kg)):
        if not (np.isfinite(value) and value > 0):
            raise ConfigError(f"{name} must be positive and finite, got {value}.")
    if source in conveyor_names():
        known = conveyor_object(source)
        name, model, known_mass = known.name, known.model, known.mass_kg * scale**3
    elif source == BOTTLE:
        model = bottle(*BOTTLE_SIZE_M)
        name, known_mass = BOTTLE, BOTTLE_KG * scale**3
    else:
        model = load_files(_files(Path(source).expanduser()))
        name, known_mass = model.name, DENSITY_KGM3 * model.volume_m3 * scale**3
    return ConveyorObject(name, model if scale == 1.0 else model.scaled(scale), mass_kg or known_mass)


def _files(path: Path) -> ObjectFiles:
    if path.is_dir():
        return files_in(path)
    if not path.is_file():
        raise ConfigError(
            f"{unknown_name('object', str(path), conveyor_names())} It may also be the path of a mesh file or of an"
            " object's folder."
        )
    if path.suffix.lower() not in (".obj", ".ply", ".stl", ".glb", ".off"):
        raise MeshError(f"{path} is no mesh file; give one of .obj, .ply, .stl, .glb, .off.")
    return ObjectFiles(path.stem, path.parent, visual=path, collision=None)
