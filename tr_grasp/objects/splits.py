"""Which objects of a folder are for training and which for testing; no object is ever in both."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Literal, NamedTuple

from tr_grasp.errors import ConfigError, MeshError
from tr_grasp.objects.family import SPLITS, Split
from tr_grasp.objects.layouts import ObjectFiles, objects_in
from tr_grasp.objects.rejection import Reason, Rejection

SPLIT_FILE = "split.json"
TEST_ONE_IN = 5
"""Share of the test split in published data sets that come without one (the thesis takes 20 of 100)."""

Overlap = Literal["refuse", "leave_out"]
Halves = dict[Split, list[ObjectFiles]]


class Twin(NamedTuple):
    """One object that is in both splits."""

    train: ObjectFiles
    test: ObjectFiles


def objects_of(folder: Path, split: Split, overlap: Overlap = "refuse") -> tuple[list[ObjectFiles], list[Rejection]]:
    """The split's objects, sorted by name, and those that were left out because training has them.

    The first of these that is there decides: sub-folders ``train`` and ``test``; a file ``split.json`` with the names
    in each (``{"train": ["mug"], "test": ["bowl"]}``); in published layouts, a hash of the object's name, so that an
    object is in the same split wherever it is used. Any other folder serves either split.

    Args:
        folder: Where the objects are.
        split: Which of them.
        overlap: What to do with objects of both splits, that is of one name or with equal visual files: ``refuse`` the
            folder, or ``leave_out`` these objects when testing.

    Raises:
        MeshError: The folder is missing, or has only the other split.
        ConfigError: ``split.json`` is wrong, or train and test share an object and that is refused.
    """
    if not folder.is_dir():
        raise MeshError(f"{folder} is missing or not a folder; name one with a sub-folder for each object.")
    halves = _halves(folder)
    if halves is None:
        return objects_in(folder), []
    if split not in halves:
        other = next(name for name in SPLITS if name != split)
        raise MeshError(f"{folder} has {other!r} but no {split!r} objects; add the sub-folder {folder / split}.")
    twins = _in_both(*(halves.get(name, []) for name in SPLITS))
    if twins and overlap == "refuse":
        raise ConfigError(
            f"train and test in {folder} share {', '.join(map(_named, twins))}; keep every object in one of them only,"
            " or set objects.overlap to leave_out."
        )
    left_out = {twin.test.name: twin for twin in twins} if split == "test" else {}
    return [files for files in halves[split] if files.name not in left_out], [
        Rejection(name, Reason.IN_TRAINING, f"{twin.test.folder} is the same object as {twin.train.folder}.")
        for name, twin in left_out.items()
    ]


def hashed_split(key: str) -> Split:
    """``test`` for one in ``TEST_ONE_IN`` keys, the same ones everywhere.

    >>> hashed_split("006"), hashed_split("007")
    ('train', 'test')
    """
    number = int.from_bytes(hashlib.sha256(f"split:{key}".encode()).digest()[:8], "big")
    return "test" if number % TEST_ONE_IN == 0 else "train"


def _halves(folder: Path) -> Halves | None:
    """The objects of every split that the folder has; none where it makes no difference."""
    present: list[Split] = [split for split in SPLITS if (folder / split).is_dir()]
    if present:
        return {split: objects_in(folder / split) for split in present}
    objects = objects_in(folder)
    if (folder / SPLIT_FILE).is_file():
        return _listed(folder / SPLIT_FILE, objects)
    keys = [files.split_key for files in objects]
    if not objects or None in keys:
        return None
    sides: list[Split] = [hashed_split(key) for key in keys if key is not None]
    halves: Halves = {"train": [], "test": []}
    for files, side in zip(objects, sides, strict=True):
        halves[side].append(files)
    return halves


def _listed(path: Path, objects: Sequence[ObjectFiles]) -> Halves:
    by_name = {files.name: files for files in objects}
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        names: dict[Split, list[str]] = {split: [str(name) for name in content[split]] for split in SPLITS}
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ConfigError(
            f'{path} must be {{"train": [names], "test": [names]}}, got an error: {error!r}; correct it.'
        ) from error
    unknown = sorted({name for listed in names.values() for name in listed} - set(by_name))
    if unknown:
        raise ConfigError(f"{path} names objects that {path.parent} does not hold: {', '.join(unknown)}; correct it.")
    return {split: [by_name[name] for name in sorted(set(listed))] for split, listed in names.items()}


def _in_both(train: Sequence[ObjectFiles], test: Sequence[ObjectFiles]) -> list[Twin]:
    """Test objects that training has too, under the same name or under another."""
    by_name = {files.name: files for files in train}
    by_length: dict[int, list[ObjectFiles]] = {}
    for files in train:
        if files.visual.is_file():
            by_length.setdefault(files.visual.stat().st_size, []).append(files)
    twins = []
    for files in test:
        # Reading a whole data set takes long, so files are read only where another one is as long.
        alike = by_length.get(files.visual.stat().st_size, []) if files.visual.is_file() else []
        equal = (twin for twin in alike if _content_hash(twin.visual) == _content_hash(files.visual))
        twin = by_name.get(files.name) or next(equal, None)
        if twin is not None:
            twins.append(Twin(twin, files))
    return twins


def _named(twin: Twin) -> str:
    same = twin.train.name == twin.test.name
    return twin.test.name if same else f"{twin.test.name} (equal to {twin.train.name})"


def _content_hash(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
