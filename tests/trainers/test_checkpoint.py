from __future__ import annotations

import itertools
import multiprocessing
import os
import random
import resource
import signal
from pathlib import Path

import numpy as np
import pytest
import torch

from tr_grasp.errors import CheckpointError, StorageError
from tr_grasp.trainers.checkpoint import load_checkpoint, random_state, save_checkpoint, set_random_state

FORK = multiprocessing.get_context("fork")


def test_what_was_saved_comes_back(tmp_path):
    state = {"counters": {"env_steps": 3, "best": [0.5]}, "replay": {"codes": torch.arange(5, dtype=torch.int16)}}
    save_checkpoint(tmp_path / "c.pt", state)
    loaded = load_checkpoint(tmp_path / "c.pt")
    assert loaded["counters"] == state["counters"]
    assert torch.equal(loaded["replay"]["codes"], state["replay"]["codes"])


def test_nothing_else_stays_in_the_folder(tmp_path):
    for value in range(3):
        save_checkpoint(tmp_path / "c.pt", {"value": value})
    assert [path.name for path in tmp_path.iterdir()] == ["c.pt"]


def test_the_random_generators_of_a_run_go_on_where_they_were():
    def draw():
        return [torch.rand(2).tolist(), np.random.rand(2).tolist(), np.random.randn(1).tolist()]  # noqa: NPY002

    np.random.randn(1)  # noqa: NPY002 -- leaves half a pair of Gaussians behind
    state = random_state()
    first = draw()
    set_random_state(state)
    assert draw() == first


def test_random_states_survive_the_file(tmp_path):
    save_checkpoint(tmp_path / "c.pt", {"random": random_state()})
    expected = torch.rand(3), np.random.rand()  # noqa: NPY002
    set_random_state(load_checkpoint(tmp_path / "c.pt")["random"])
    got = torch.rand(3), np.random.rand()  # noqa: NPY002
    assert torch.equal(expected[0], got[0])
    assert expected[1] == got[1]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "corrupt or no checkpoint"),
        (b"not a checkpoint at all", "corrupt or no checkpoint"),
        (None, "nothing to resume"),
    ],
)
def test_files_that_are_no_checkpoints_are_refused(tmp_path, content, message):
    if content is not None:
        (tmp_path / "c.pt").write_bytes(content)
    with pytest.raises(CheckpointError, match=message):
        load_checkpoint(tmp_path / "c.pt")


def test_a_truncated_file_is_refused(tmp_path):
    save_checkpoint(tmp_path / "c.pt", {"x": torch.zeros(1000)})
    content = (tmp_path / "c.pt").read_bytes()
    (tmp_path / "c.pt").write_bytes(content[: len(content) // 2])
    with pytest.raises(CheckpointError, match="corrupt"):
        load_checkpoint(tmp_path / "c.pt")


def test_foreign_files_and_other_versions_are_refused(tmp_path):
    torch.save({"model": torch.zeros(3)}, tmp_path / "foreign.pt")
    with pytest.raises(CheckpointError, match="no checkpoint of this package"):
        load_checkpoint(tmp_path / "foreign.pt")
    torch.save({"format": "tr_grasp.checkpoint", "version": 99}, tmp_path / "newer.pt")
    with pytest.raises(CheckpointError, match="version 99, this package reads version 1"):
        load_checkpoint(tmp_path / "newer.pt")


def test_a_checkpoint_without_its_parts_is_refused(tmp_path):
    save_checkpoint(tmp_path / "c.pt", {"rows": []})
    with pytest.raises(CheckpointError, match="session is missing"):
        load_checkpoint(tmp_path / "c.pt", ("session", "rows"))


def test_code_in_a_file_is_not_run(tmp_path):
    class Evil:
        def __reduce__(self):
            return (os.mkdir, (str(tmp_path / "was_here"),))

    torch.save({"format": "tr_grasp.checkpoint", "version": 1, "x": Evil()}, tmp_path / "evil.pt")
    with pytest.raises(CheckpointError):
        load_checkpoint(tmp_path / "evil.pt")
    assert not (tmp_path / "was_here").exists()


def save_for_ever(path: Path) -> None:
    for n in itertools.count():
        save_checkpoint(path, {"n": n, "big": torch.full((2_000_000,), float(n))})


def test_killing_a_process_that_saves_leaves_a_whole_checkpoint(tmp_path):
    """However often it is killed, the file is there and its parts belong together."""
    path, delays = tmp_path / "c.pt", random.Random(0)
    save_checkpoint(path, {"n": -1, "big": torch.full((2_000_000,), -1.0)})
    for _ in range(10):
        process = FORK.Process(target=save_for_ever, args=(path,))
        process.start()
        process.join(delays.uniform(0.0, 0.2))
        process.kill()
        process.join()
        state = load_checkpoint(path)
        assert (state["big"] == state["n"]).all()


def save_beyond_the_limit(path: Path, answer) -> None:
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
    try:
        save_checkpoint(path, {"x": torch.zeros(1_000_000)})
    except StorageError as error:
        answer.put(str(error))


def test_a_full_disk_keeps_the_checkpoint_before(tmp_path):
    """A file-size limit of the process stands for the disk's end; the writer sees the same kind of error."""
    save_checkpoint(tmp_path / "c.pt", {"x": torch.zeros(10)})
    answer = FORK.SimpleQueue()
    process = FORK.Process(target=save_beyond_the_limit, args=(tmp_path / "c.pt", answer))
    process.start()
    process.join(60)
    assert not answer.empty()
    sentence = answer.get()
    assert "could not write" in sentence
    assert sentence.endswith("still whole.")
    assert "\n" not in sentence
    assert load_checkpoint(tmp_path / "c.pt")["x"].shape == (10,)
    assert [path.name for path in tmp_path.iterdir()] == ["c.pt"]


def test_a_folder_that_does_not_exist_is_a_storage_error(tmp_path):
    with pytest.raises(StorageError, match="could not write"):
        save_checkpoint(tmp_path / "nowhere" / "c.pt", {})
