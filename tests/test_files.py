from __future__ import annotations

import pytest

from tr_grasp.errors import StorageError
from tr_grasp.files import remove_partial_files, write_atomically


def test_text_bytes_and_writers_are_written(tmp_path):
    path = tmp_path / "file"
    for content in ("ä", "ä".encode(), lambda file: file.write("ä".encode())):
        write_atomically(path, content)
        assert path.read_text(encoding="utf-8") == "ä"
        path.unlink()


def test_a_writer_that_fails_leaves_the_file_as_it_was(tmp_path):
    path = tmp_path / "file"
    path.write_text("before")

    def fail(file):
        file.write(b"half of i")
        raise OSError(28, "No space left on device")

    with pytest.raises(StorageError, match=r"No space left on device; the file that was there before is still whole\."):
        write_atomically(path, fail)
    assert path.read_text() == "before"
    assert [each.name for each in tmp_path.iterdir()] == ["file"]


def test_mistakes_of_the_caller_are_not_called_storage_errors(tmp_path):
    def fail(file):
        raise KeyError("mine")

    with pytest.raises(KeyError):
        write_atomically(tmp_path / "file", fail)
    assert not list(tmp_path.iterdir())


def test_others_may_read_the_file(tmp_path):
    write_atomically(tmp_path / "file", "x")
    assert (tmp_path / "file").stat().st_mode & 0o777 == 0o644


def test_leftovers_of_a_killed_process_are_removed_and_nothing_else(tmp_path):
    (tmp_path / ".checkpoint.pt.abc.partial").write_text("half")
    (tmp_path / "notes.partial").write_text("mine")
    remove_partial_files(tmp_path)
    assert [each.name for each in tmp_path.iterdir()] == ["notes.partial"]
