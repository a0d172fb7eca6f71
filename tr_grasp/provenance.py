"""What a result needs beside its number: command, commit, versions, machine."""

from __future__ import annotations

import os
import platform
import subprocess
from dataclasses import asdict, dataclass, field
from datetime import datetime, timezone
from importlib import metadata
from pathlib import Path
from typing import Any

import tr_grasp

_PACKAGES = ("torch", "torchrl", "tensordict", "numpy", "mani_skill", "sapien", "open3d")
_CPU_FILE = Path("/proc/cpuinfo")


@dataclass(frozen=True)
class Provenance:
    """Where a result comes from."""

    command: str
    """The command, as typed in a terminal."""
    commit: str | None = None
    """Commit of the source tree, ``-dirty`` if something was changed since; None outside of a source tree."""
    started: str = ""
    """Universal time, ISO 8601."""
    machine: str = ""
    """Processor and its number of cores."""
    versions: dict[str, str] = field(default_factory=dict)
    """Of this package, Python and the libraries that decide results."""

    def as_json(self) -> dict[str, Any]:
        """Plain dictionary."""
        return asdict(self)


def provenance(command: str) -> Provenance:
    """Provenance of what ``command`` is about to produce on this machine."""
    return Provenance(
        command=command,
        commit=source_commit(Path(tr_grasp.__file__).parents[1]),
        started=datetime.now(timezone.utc).isoformat(timespec="seconds"),
        machine=f"{_processor()}, {cores_n()} cores",
        versions={"tr_grasp": tr_grasp.__version__, "python": platform.python_version(), **_versions()},
    )


def cores_n() -> int:
    """Processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def source_commit(root: Path) -> str | None:
    """Commit that is checked out in ``root``; None if that is not the root of a repository with a commit."""
    if not (root / ".git").exists():
        return None
    command = ["git", "-C", str(root), "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True, timeout=10).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return None


def _processor() -> str:
    if _CPU_FILE.is_file():
        for line in _CPU_FILE.read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()


def _versions() -> dict[str, str]:
    installed = {
        name.replace("-", "_"): name for name in (d.metadata["Name"] for d in metadata.distributions()) if name
    }
    names = {package: installed.get(package) or installed.get(f"{package}_cpu") for package in _PACKAGES}
    return {package: metadata.version(name) for package, name in names.items() if name}
