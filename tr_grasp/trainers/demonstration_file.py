"""Demonstrations on disk: one HDF5 file of one world, whole at any moment.

    /                    format, version, recording (JSON), versions (JSON)
    /episodes/000000     seed, success, outcome, steps, reward, objects, commit
        codes features proprio stages expert_action expert_target    one row an observation, T + 1
        action reward terminated truncated                           one row a step, T

Every observation is stored once, compressed and with a checksum; stacks are put together when they are read. All
episodes of a file have the settings of its ``recording``.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

import h5py

from tr_grasp.configs import EnvCfg
from tr_grasp.configs.build import build, leaf_types, plain
from tr_grasp.errors import ConfigError, DemonstrationError
from tr_grasp.files import write_atomically
from tr_grasp.trainers.demonstration import OBSERVATION_ARRAYS, STEP_ARRAYS, Demonstration, EpisodeInfo

FORMAT = "tr_grasp.demonstrations"
VERSION = 1
COMPRESSION = {"compression": "gzip", "compression_opts": 4, "shuffle": True, "fletcher32": True}
OPTIONAL = ("expert_target",)


@dataclass(frozen=True)
class Recording:
    """How the episodes of a file are made; with the seed it decides an episode."""

    env: EnvCfg = field(default_factory=EnvCfg)
    """The world."""

    noise_scale: tuple[float, ...] = ()
    """Action noise; each episode draws one of these standard deviations."""

    gripper_flip_probability: float = 0.0
    """Chance of opening instead of closing, or the reverse, in a step."""

    wander_steps: int = 0
    """An episode begins with up to so many random motions."""

    episode_steps: int = 100
    """Episodes are cut here."""


class DemonstrationFile:
    """A file that can be read.

    Args:
        path: The file.

    Raises:
        DemonstrationError: It is missing, damaged, foreign or of another version.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with _opened(path) as file:
            self.recording = _recording(path, file)
            self.versions: dict[str, str] = json.loads(file.attrs["versions"])
            self.episodes = [_info(group) for group in file["episodes"].values()]
            self._names = list(file["episodes"])

    def __len__(self) -> int:
        return len(self.episodes)

    def __getitem__(self, index: int) -> Demonstration:
        """An episode, in the order of recording.

        Raises:
            DemonstrationError: It is damaged.
        """
        with _opened(self.path) as file:
            group: Any = file["episodes"][self._names[index]]
            wanted = [name for name in (*OBSERVATION_ARRAYS, *STEP_ARRAYS) if name in group or name not in OPTIONAL]
            arrays = {name: group[name][()] for name in wanted}
        info = self.episodes[index]
        if any(len(arrays[name]) != info.steps + (name in OBSERVATION_ARRAYS) for name in arrays):
            raise DemonstrationError(f"'{self.path}' is damaged: episode {index} has not {info.steps} steps.")
        return Demonstration(info, arrays)

    def __iter__(self) -> Iterator[Demonstration]:
        return (self[index] for index in range(len(self)))

    @property
    def transitions_n(self) -> int:
        """Steps of all episodes."""
        return sum(episode.steps for episode in self.episodes)


def append_demonstrations(
    path: Path, recording: Recording, demonstrations: Iterable[Demonstration], versions: dict[str, str]
) -> None:
    """Add episodes to a file, or begin one. Whoever reads it meanwhile, or after a crash, sees all or none of them.

    Args:
        path: The file.
        recording: How they were made; a file that is there must hold the same.
        demonstrations: In this order.
        versions: Of the libraries that made them; kept of the first ones.

    Raises:
        DemonstrationError: The file that is there is no such file, or has other settings.
        StorageError: It could not be written; the file before is still whole.
    """
    exists = path.exists()
    if exists:
        check_same_recording(DemonstrationFile(path), recording)

    def write(target: BinaryIO) -> None:
        if exists:
            with path.open("rb") as source:
                shutil.copyfileobj(source, target)
        with h5py.File(target, "r+" if exists else "w", libver="latest") as file:
            if not exists:
                file.attrs.update({"format": FORMAT, "version": VERSION, "versions": json.dumps(versions)})
                file.attrs["recording"] = json.dumps(plain(recording))
            episodes = file.require_group("episodes")
            for index, demonstration in enumerate(demonstrations, start=len(episodes)):
                _write(episodes.create_group(f"{index:06}"), demonstration)

    write_atomically(path, write)


def check_same_recording(file: DemonstrationFile, recording: Recording) -> None:
    """A file goes on only with the settings it began with.

    Raises:
        DemonstrationError: The first setting that differs.
    """
    names = [name for name, _ in leaf_types(Recording)]
    require_equal(file, recording, names, "name another file or record with the same settings")


def require_equal(file: DemonstrationFile, wanted: Recording, names: Iterable[str], advice: str) -> None:
    """Refuse a file in which one of the named settings (dotted paths, or groups of settings) differs.

    Raises:
        DemonstrationError: The first one that differs.
    """
    for name in names:
        there, here = _setting(file.recording, name), _setting(wanted, name)
        if there != here:
            raise DemonstrationError(f"'{file.path}' was recorded with {name} {there}, not {here}; {advice}.")


def _setting(recording: Recording, name: str) -> Any:
    value: Any = recording
    for part in name.split("."):
        value = getattr(value, part)
    return plain(value)


@contextmanager
def _opened(path: Path) -> Iterator[h5py.File]:
    """The file, checked to be one of ours."""
    if not path.is_file():
        raise DemonstrationError(f"there are no demonstrations at '{path}'; make them with `tr-grasp demos record`.")
    try:
        with h5py.File(path, "r") as file:
            if file.attrs.get("format") != FORMAT:
                raise DemonstrationError(f"'{path}' is an HDF5 file, but holds no demonstrations of this package.")
            if file.attrs["version"] != VERSION:
                raise DemonstrationError(
                    f"'{path}' has version {file.attrs['version']} of its format, this package reads version "
                    f"{VERSION}; read it with the release that wrote it."
                )
            yield file
    except DemonstrationError:
        raise
    except (OSError, KeyError, ValueError, TypeError, RuntimeError) as error:
        reason = str(error).splitlines()[0].strip("'\"") if str(error) else type(error).__name__
        raise DemonstrationError(f"'{path}' is damaged or no HDF5 file: {reason}.") from error


def _recording(path: Path, file: h5py.File) -> Recording:
    try:
        return build(Recording(), json.loads(file.attrs["recording"]), source=str(path))
    except ConfigError as error:
        raise DemonstrationError(f"'{path}' has settings that this release does not know: {error}.") from error


def _info(group: h5py.Group) -> EpisodeInfo:
    a = group.attrs
    return EpisodeInfo(
        seed=int(a["seed"]),
        success=bool(a["success"]),
        outcome=str(a["outcome"]),
        steps=int(a["steps"]),
        reward=float(a["reward"]),
        objects=tuple(json.loads(a["objects"])),
        commit=str(a["commit"]),
    )


def _write(group: h5py.Group, demonstration: Demonstration) -> None:
    attributes = {**vars(demonstration.info), "objects": json.dumps(demonstration.info.objects)}
    group.attrs.update(attributes)
    for name, array in demonstration.arrays.items():
        group.create_dataset(name, data=array, chunks=array.shape, **COMPRESSION)
