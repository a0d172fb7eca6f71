"""The table of trials: a CSV file that grows by a row as each trial ends, and can be gone on with."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable
from dataclasses import fields
from pathlib import Path
from types import TracebackType
from typing import Any, TextIO

from tr_grasp.dynamic.record import TrialKey, TrialRecord
from tr_grasp.errors import ConfigError, StorageError
from tr_grasp.files import make_folder, write_atomically

TRIALS_FILE = "trials.csv"
COLUMNS = tuple(column.name for column in fields(TrialRecord))


class TrialLog:
    """Open it as a context; it begins with the whole rows that are there, and drops one that was cut off.

    Attributes:
        records: All rows, by their key: a trial that is written twice counts once.

    Raises:
        ConfigError: The file is there and is another table.
        StorageError: It cannot be written.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / TRIALS_FILE
        self._file: TextIO | None = None
        self.records: dict[TrialKey, TrialRecord] = {}

    def __enter__(self) -> TrialLog:
        make_folder(self._path.parent)
        found = read_trials(self._path, whole_rows_only=True) if self._path.is_file() else []
        self.records = {record.key: record for record in found}
        write_atomically(self._path, as_csv(self.records.values()))
        try:
            self._file = self._path.open("a", newline="", encoding="utf-8")
        except OSError as error:
            raise StorageError(f"cannot write {self._path}: {error.strerror or error}.") from error
        return self

    def append(self, record: TrialRecord) -> None:
        """Write a row and hand it to the system at once."""
        assert self._file is not None, "enter the log before rows are appended"
        self.records[record.key] = record
        try:
            csv.writer(self._file).writerow(_row(record))
            self._file.flush()
        except OSError as error:
            raise StorageError(f"cannot write {self._path}: {error.strerror or error}.") from error

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._file is not None:
            self._file.close()


def as_csv(records: Iterable[TrialRecord]) -> str:
    """Head and rows."""
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(COLUMNS)
    writer.writerows(map(_row, records))
    return text.getvalue()


def read_trials(path: Path, *, whole_rows_only: bool = False) -> list[TrialRecord]:
    """Read the table of a folder, or a file.

    Args:
        path: Which.
        whole_rows_only: A last row that was cut off (a killed program, a full disk) is left out, not refused.

    Raises:
        ConfigError: No such file, or no table of trials.
    """
    file = path / TRIALS_FILE if path.is_dir() else path
    if not file.is_file():
        raise ConfigError(f"{file} does not exist; name the folder that `tr-grasp dynamic evaluate` wrote.")
    try:
        with file.open(newline="", encoding="utf-8") as stream:
            reader = csv.DictReader(stream)
            rows, head = list(reader), reader.fieldnames or []
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ConfigError(f"{file} cannot be read as CSV: {error}.") from error
    if missing := [column for column in COLUMNS if column not in head]:
        raise ConfigError(f"{file} is not a table of trials: it lacks the column(s) {', '.join(missing)}.")
    records = []
    for number, row in enumerate(rows):
        try:
            records.append(TrialRecord(**{name: _PARSERS[name](row[name]) for name in COLUMNS}))
        except (TypeError, ValueError, KeyError, AttributeError) as error:
            if whole_rows_only and number == len(rows) - 1:
                break
            raise ConfigError(f"{file}, line {number + 2}, is damaged: {error}.") from error
    return records


def _row(record: TrialRecord) -> list[Any]:
    return ["" if (value := getattr(record, name)) is None else value for name in COLUMNS]


_WORDS = {
    "str": str,
    "int": int,
    "float": float,
    "bool": {"True": True, "False": False}.__getitem__,
    "float | None": lambda text: float(text) if text else None,
}
_PARSERS = {column.name: _WORDS[str(column.type)] for column in fields(TrialRecord)}
