from __future__ import annotations

import subprocess
from pathlib import Path

import tr_grasp
from tr_grasp.provenance import provenance, source_commit


def git(folder: Path, *words: str) -> str:
    identity = ["-c", "user.name=a", "-c", "user.email=a@b"]
    command = ["git", "-C", str(folder), *identity, *words]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


def test_the_commit_is_told_and_whether_something_changed_since(tmp_path: Path) -> None:
    assert source_commit(tmp_path) is None
    git(tmp_path, "init", "-q")
    assert source_commit(tmp_path) is None
    (tmp_path / "a").write_text("1")
    git(tmp_path, "add", "a")
    git(tmp_path, "commit", "-q", "-m", "x")
    head = git(tmp_path, "rev-parse", "HEAD")
    assert source_commit(tmp_path) == head
    (tmp_path / "a").write_text("2")
    assert source_commit(tmp_path) == f"{head}-dirty"


def test_versions_and_machine_are_told() -> None:
    source = provenance("tr-grasp evaluate zero")
    assert source.command == "tr-grasp evaluate zero"
    assert source.versions["tr_grasp"] == tr_grasp.__version__
    assert {"python", "torch", "torchrl", "mani_skill", "sapien"} <= set(source.versions)
    assert source.machine.endswith("cores")
    assert source.as_json()["versions"] == source.versions
