"""Files that are whole or not there: never half-written, whatever happens to the process."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

from tr_grasp.errors import StorageError

CACHE_VARIABLE = "TR_GRASP_CACHE"


def write_atomically(path: str | Path, content: bytes | str | Callable[[BinaryIO], None]) -> None:
    """Replace a file in one step: whoever reads it, at any time, sees all of the old or all of the new one.

    Args:
        path: The file; its folder exists.
        content: Bytes, text (UTF-8), or a function that writes to an open file (and may read what it wrote).

    Raises:
        StorageError: It could not be written (full disk, no permission); the old file is untouched.
    """
    path = Path(path)
    temporary: str | None = None
    try:
        handle, temporary = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".partial", dir=path.parent)
        with os.fdopen(handle, "w+b") as file:
            _fill(file, content)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
        temporary = None
        _sync_folder(path.parent)
    # PyTorch's writer reports a full disk as a RuntimeError.
    except (OSError, RuntimeError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error).splitlines()[0]
        kept = "; the file that was there before is still whole" if path.exists() else ""
        raise StorageError(f"could not write '{path}': {reason}{kept}.") from error
    finally:
        if temporary is not None and os.path.exists(temporary):
            os.unlink(temporary)


def make_folder(folder: Path) -> None:
    """Make a folder and those above it, if they are not there.

    Raises:
        StorageError: It could not be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StorageError(f"could not make the folder '{folder}': {error.strerror}.") from error


def cache_folder() -> Path:
    """Where files that can be made again are kept: ``TR_GRASP_CACHE``, or ``tr_grasp`` in the user's cache folder."""
    if os.environ.get(CACHE_VARIABLE):
        return Path(os.environ[CACHE_VARIABLE]).expanduser()
    return Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / "tr_grasp"


def write_once(path: Path, make_text: Callable[[], str]) -> Path:
    """A file that is named after its content: written if it is not there yet, its folder too.

    Raises:
        StorageError: It could not be written.
    """
    if not path.is_file():
        text = make_text()
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise StorageError(
                f"could not make '{path.parent}': {error.strerror}; "
                f"set {CACHE_VARIABLE} to a folder that can be written."
            ) from error
        write_atomically(path, text)
    return path


def remove_partial_files(folder: str | Path) -> None:
    """Delete what a killed process left of its unfinished files in ``folder``."""
    for partial in Path(folder).glob(".*.partial"):
        partial.unlink(missing_ok=True)


def _fill(file: BinaryIO, content: bytes | str | Callable[[BinaryIO], None]) -> None:
    if callable(content):
        content(file)
    else:
        file.write(content.encode() if isinstance(content, str) else content)


def _sync_folder(folder: Path) -> None:
    """Make the rename itself durable."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
