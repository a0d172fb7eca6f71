"""One row per episode, and the CSV file that keeps them."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable
from dataclasses import dataclass, field, fields
from pathlib import Path
from types import TracebackType
from typing import Any, TextIO

from tr_grasp.errors import ConfigError, StorageError
from tr_grasp.files import write_atomically

EPISODES_FILE = "episodes.csv"
_SEPARATOR = " + "


@dataclass(frozen=True)
class EpisodeRecord:
    """What happened in one episode. Records are equal if all but the wall time is."""

    suite: str
    """Name of the suite that the episode belongs to."""
    episode: int
    """Its number in the suite, from 0."""
    seed: int
    """Seed of its scene, noise and policy."""
    success: bool
    """An object was lifted."""
    outcome: str
    """How it ended, in words: success, or the reason of the failure."""
    steps: int
    """Policy steps."""
    reward: float
    """Sum of the rewards."""
    objects_n: int
    """Objects in the scene."""
    objects: tuple[str, ...]
    """Their names."""
    families: tuple[str, ...]
    """What kinds they are, one for each object."""
    reached: bool
    """The tool came near an object."""
    touched: bool
    """The gripper touched an object."""
    grasped: bool
    """An object was held."""
    lifted: bool
    """A held object was lifted."""
    wall_s: float = field(compare=False)
    """Seconds of wall time, scene building included."""


COLUMNS = tuple(column.name for column in fields(EpisodeRecord))


def in_order(records: Iterable[EpisodeRecord]) -> list[EpisodeRecord]:
    """Suites in order of appearance, each by episode number."""
    records = list(records)
    suites = list(dict.fromkeys(record.suite for record in records))
    return sorted(records, key=lambda record: (suites.index(record.suite), record.episode))


def by_suite(records: Iterable[EpisodeRecord]) -> dict[str, list[EpisodeRecord]]:
    """The records of each suite, suites in order of appearance."""
    groups: dict[str, list[EpisodeRecord]] = {}
    for record in records:
        groups.setdefault(record.suite, []).append(record)
    return groups


class EpisodeLog:
    """A CSV file that holds every finished episode, also if the program is killed in the next one."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file: TextIO | None = None

    def __enter__(self) -> EpisodeLog:
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._file = self._path.open("w", newline="", encoding="utf-8")
        except OSError as error:
            raise StorageError(f"cannot write {self._path}: {error.strerror or error}.") from error
        self._write(COLUMNS)
        return self

    def append(self, record: EpisodeRecord) -> None:
        """Write one row and hand it to the system at once."""
        self._write(_row(record))

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._file is not None:
            self._file.close()

    def _write(self, row: Iterable[Any]) -> None:
        if self._file is None:
            raise RuntimeError("EpisodeLog must be entered before rows are appended")
        try:
            csv.writer(self._file).writerow(row)
            self._file.flush()
        except OSError as error:
            raise StorageError(f"cannot write {self._path}: {error.strerror or error}.") from error


def write_episodes(path: Path, records: Iterable[EpisodeRecord]) -> None:
    """Write all records at once, in order, into an existing folder.

    Raises:
        StorageError: If the file cannot be written.
    """
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(COLUMNS)
    writer.writerows(_row(record) for record in in_order(records))
    write_atomically(path, text.getvalue())


def read_episodes(path: Path) -> list[EpisodeRecord]:
    """Read the episodes of an evaluation from its folder or CSV file.

    Raises:
        ConfigError: If there is no such file, or it is not a table of episodes.
    """
    file = path / EPISODES_FILE if path.is_dir() else path
    if not file.is_file():
        raise ConfigError(f"{file} does not exist; name the folder or the CSV file that `tr-grasp evaluate` wrote.")
    try:
        with file.open(newline="", encoding="utf-8") as stream:
            rows = list(csv.DictReader(stream))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ConfigError(f"{file} cannot be read as CSV: {error}.") from error
    if not rows:
        raise ConfigError(f"{file} holds no episodes.")
    missing = [column for column in COLUMNS if column not in rows[0]]
    if missing:
        raise ConfigError(f"{file} is not a table of episodes: it lacks the column(s) {', '.join(missing)}.")
    return [_record(row, f"{file}, line {line}") for line, row in enumerate(rows, start=2)]


def _row(record: EpisodeRecord) -> list[Any]:
    values = (getattr(record, column) for column in COLUMNS)
    return [_SEPARATOR.join(value) if isinstance(value, tuple) else value for value in values]


def _record(row: dict[str, Any], place: str) -> EpisodeRecord:
    values: dict[str, Any] = {}
    for column in fields(EpisodeRecord):
        text = row[column.name]
        try:
            # A row that was cut short (a killed program, a full disk) reads as None.
            values[column.name] = _PARSERS[str(column.type)](text.strip())
        except (AttributeError, ValueError, KeyError):
            raise ConfigError(f"{place}: {column.name} must be {_WORDS[str(column.type)]}, got {text!r}.") from None
    return EpisodeRecord(**values)


_PARSERS = {
    "str": str,
    "int": int,
    "float": float,
    "bool": {"True": True, "False": False}.__getitem__,
    "tuple[str, ...]": lambda text: tuple(text.split(_SEPARATOR)) if text else (),
}
_WORDS = {
    "str": "a text",
    "int": "a whole number",
    "float": "a number",
    "bool": "True or False",
    "tuple[str, ...]": "names with plus signs between",
}
