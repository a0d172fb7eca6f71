"""Where data sets keep the meshes of an object: this project's folders, ManiSkill's YCB, Google Scanned Objects."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path

from tr_grasp.errors import MeshError
from tr_grasp.objects.mesh_checks import UNSCALED, Scale
from tr_grasp.objects.rejection import Reason, RejectedMesh

COLLISION_FILE = "collision.obj"
VISUAL_FILES = ("visual.ply", "visual.obj")
CATALOGUE_FILE = "info_pick_v0.json"
"""What ManiSkill's ``mani_skill2_ycb`` folder has beside ``models``."""


@dataclass(frozen=True)
class ObjectFiles:
    """The files of one object, whether they exist or not, and what its data set says about them."""

    name: str
    """Which object; the name of its folder."""

    folder: Path
    """Where all of it is."""

    visual: Path
    """What cameras see."""

    collision: Path | None
    """Convex parts; none where the data set publishes none and they are made from the visual mesh."""

    texture: Path | None = None
    """Picture to use where the visual file names one that is not beside it."""

    scale: Scale = UNSCALED
    """Factor along each axis that brings the meshes to metres."""

    sdf: Path | None = None
    """Model description whose scale counts instead."""

    split_key: str | None = None
    """What decides, where a published data set has no split of its own, into which split the object falls."""

    def scale_to_metres(self) -> Scale:
        """The factor along each axis.

        Raises:
            RejectedMesh: The model description cannot be read.
        """
        return self.scale if self.sdf is None or not self.sdf.is_file() else sdf_scale(self.sdf)


def objects_in(folder: Path) -> list[ObjectFiles]:
    """The objects of a folder, sorted by name; each sub-folder is one, in whatever layout it is.

    Raises:
        MeshError: The catalogue of ManiSkill's layout cannot be read.
    """
    if (folder / CATALOGUE_FILE).is_file():
        return _maniskill_ycb(folder)
    return [files_in(sub_folder) for sub_folder in sub_folders(folder)]


def files_in(folder: Path) -> ObjectFiles:
    """The files of an object of this project's layout, or of Google's if it has a folder ``meshes``."""
    if (folder / "meshes").is_dir():
        return ObjectFiles(
            folder.name,
            folder,
            visual=folder / "meshes" / "model.obj",
            collision=None,
            texture=folder / "materials" / "textures" / "texture.png",
            sdf=folder / "model.sdf",
            split_key=folder.name.lower(),
        )
    visuals = [folder / name for name in VISUAL_FILES]
    # If none exists, the first name, so that the error names it.
    visual = next((path for path in visuals if path.is_file()), visuals[0])
    return ObjectFiles(folder.name, folder, visual, folder / COLLISION_FILE)


def sub_folders(folder: Path) -> list[Path]:
    """Folders in a folder, sorted by name; hidden ones left out."""
    return sorted(path for path in folder.iterdir() if path.is_dir() and not path.name.startswith("."))


def sdf_scale(path: Path) -> Scale:
    """The scale of the first mesh in a model description; 1 where it says nothing.

    Raises:
        RejectedMesh: The file is no XML, or the scale is not three positive numbers.
    """
    try:
        text = ElementTree.parse(path).getroot().findtext(".//mesh/scale")
        numbers = [float(word) for word in text.split()] if text else list(UNSCALED)
        x, y, z = numbers
        if not (x > 0 and y > 0 and z > 0):
            raise ValueError(f"a scale must be positive, got {text}")
    except (ElementTree.ParseError, ValueError, OSError) as error:
        raise RejectedMesh(Reason.UNREADABLE, f"cannot read {path}: {error}; correct it or remove it.") from error
    return x, y, z


def _maniskill_ycb(folder: Path) -> list[ObjectFiles]:
    catalogue = folder / CATALOGUE_FILE
    try:
        entries = json.loads(catalogue.read_text(encoding="utf-8"))
        scales = {str(name): float(entry.get("scales", [1.0])[0]) for name, entry in entries.items()}
    except (OSError, ValueError, AttributeError, LookupError, TypeError) as error:
        raise MeshError(f"cannot read {catalogue}: {error!r}; download the data set again.") from error
    return [_maniskill_object(folder / "models" / name, scale) for name, scale in sorted(scales.items())]


def _maniskill_object(folder: Path, scale: float) -> ObjectFiles:
    collisions = [folder / name for name in ("collision.ply", "collision.obj", "collision.coacd.ply")]
    collision = next((path for path in collisions if path.is_file()), collisions[0])
    # Objects of one number are one shape in several sizes (065-a_cups, 065-b_cups ...), so they stay together.
    number = folder.name.split("_")[0].split("-")[0]
    return ObjectFiles(
        folder.name, folder, folder / "textured.obj", collision, scale=(scale, scale, scale), split_key=number
    )
