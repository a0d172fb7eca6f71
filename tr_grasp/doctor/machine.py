"""The facts about a machine that decide whether the package runs on it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path


@dataclass(frozen=True)
class SystemLibrary:
    """A shared library that no Python package brings along."""

    soname: str
    """Name that the dynamic loader knows."""

    package: str
    """Debian and Ubuntu package that holds it."""

    needed_by: str
    """What does not work without it."""

    required: bool = True
    """Whether the main job needs it."""


SYSTEM_LIBRARIES = (
    SystemLibrary("libusb-1.0.so.0", "libusb-1.0-0", "Open3D, which casts the rays of the depth camera"),
    SystemLibrary("libX11.so.6", "libx11-6", "SAPIEN, the simulator"),
    SystemLibrary("libGL.so.1", "libgl1", "OpenCV and Open3D"),
    SystemLibrary("libEGL.so.1", "libegl1", "Open3D"),
    SystemLibrary("libglib-2.0.so.0", "libglib2.0-0", "OpenCV, which ManiSkill imports"),
    SystemLibrary("libgthread-2.0.so.0", "libglib2.0-0", "OpenCV, which ManiSkill imports"),
    SystemLibrary("libgomp.so.1", "libgomp1", "packages that compute with OpenMP and bring no copy", required=False),
    SystemLibrary("libXext.so.6", "libxext6", "pictures by a Vulkan driver", required=False),
)


@dataclass(frozen=True)
class Machine:
    """Everything the checks look at. Empty text means: nothing to complain about."""

    python: tuple[int, int, int]
    """Version of the running interpreter."""

    versions: Mapping[str, str]
    """Installed distributions (lower case, hyphens) and their versions."""

    import_errors: Mapping[str, str]
    """Why a module cannot be imported; modules that can are absent."""

    missing_libraries: frozenset[str] = frozenset()
    """Sonames of :data:`SYSTEM_LIBRARIES` that the loader does not find."""

    torch_cuda: str = ""
    """CUDA version that torch was built for."""

    torch_device: str = ""
    """Name of the GPU that torch can use."""

    nvidia_gpu: str = ""
    """Name of the GPU that NVIDIA's driver reports."""

    vulkan_device: str = ""
    """Name of the device that SAPIEN's renderer can use."""

    vulkan_error: str = ""
    """Why the renderer found no device."""

    folder: Path = field(default_factory=Path)
    """Working folder: runs, reports and checkpoints go below it."""

    write_error: str = ""
    """Why the working folder cannot be written."""

    free_bytes: int = 0
    """Free space there."""

    policies: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Shipped policies, each with the files that it lacks."""
