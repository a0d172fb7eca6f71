"""Judging the facts about a machine: one check, one finding, one line."""

from __future__ import annotations

import enum
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from tr_grasp.doctor.machine import SYSTEM_LIBRARIES, Machine, SystemLibrary

_SETUP = "bash scripts/setup.sh"
_OPENCV = ("opencv-python", "opencv-python-headless", "opencv-contrib-python", "opencv-contrib-python-headless")


class Severity(enum.Enum):
    """How bad a finding is; the value is what the report shows."""

    OK = "ok"
    NOTE = "note"
    WARNING = "warn"
    BROKEN = "FAIL"


@dataclass(frozen=True)
class Finding:
    """What a check found."""

    subject: str
    severity: Severity
    fact: str
    cure: str = ""
    """What to do about it, as a command where there is one."""


def examine(machine: Machine) -> list[Finding]:
    """All findings about a machine, in reading order."""
    return [check(machine) for check in CHECKS]


def check_python(machine: Machine) -> Finding:
    """The interpreter is one that all dependencies have wheels for."""
    shown = ".".join(map(str, machine.python))
    if (3, 10) <= machine.python[:2] <= (3, 12):
        return Finding("python", Severity.OK, shown)
    cure = f"PYTHON=python3.11 {_SETUP}"
    return Finding("python", Severity.BROKEN, f"{shown} is outside 3.10 to 3.12", cure)


def check_torch(machine: Machine) -> Finding:
    """Torch imports, is new enough, and is the build that suits the machine."""
    if failure := _import_failure(machine, "torch", "torch"):
        return failure
    version = machine.versions["torch"]
    if _numbers(version) < (2, 7):
        return Finding("torch", Severity.BROKEN, f"{version} is older than 2.7", "pip install -c constraints.txt torch")
    if machine.torch_cuda and not machine.nvidia_gpu:
        fact = f"{version}, CUDA {machine.torch_cuda} build, but there is no NVIDIA GPU: it works, and wastes gigabytes"
        return Finding("torch", Severity.WARNING, fact, f"TR_GRASP_TORCH_INDEX=<an index of CPU wheels> {_SETUP}")
    return Finding(
        "torch", Severity.OK, f"{version}, {f'CUDA {machine.torch_cuda}' if machine.torch_cuda else 'CPU'} build"
    )


def check_simulator(machine: Machine) -> Finding:
    """SAPIEN and ManiSkill import."""
    for module in ("sapien", "mani_skill.envs"):
        if failure := _import_failure(machine, "simulator", module):
            return failure
    return Finding(
        "simulator", Severity.OK, f"SAPIEN {machine.versions['sapien']}, ManiSkill {machine.versions['mani-skill']}"
    )


def check_vulkan(machine: Machine) -> Finding:
    """A device that SAPIEN can draw with; nothing needs it but SAPIEN's own camera."""
    if machine.vulkan_device:
        return Finding("vulkan", Severity.OK, machine.vulkan_device)
    fact = (
        f"no device ({machine.vulkan_error or 'not probed'}): no pictures by the sapien camera and tests marked render "
        "are skipped; the ray-cast camera does the work"
    )
    cure = "only if you want them: a GPU driver, or apt-get install mesa-vulkan-drivers libvulkan1 (Mesa 24.3 or newer)"
    return Finding("vulkan", Severity.WARNING, fact, cure)


def check_libusb(machine: Machine) -> Finding:
    """Open3D imports; what it usually lacks is libusb."""
    libusb = [library for library in SYSTEM_LIBRARIES if library.soname.startswith("libusb")]
    if finding := _missing_libraries(machine, "libusb", libusb):
        return finding
    if failure := _import_failure(machine, "libusb", "open3d"):
        return failure
    open3d = machine.versions.get("open3d-cpu") or machine.versions.get("open3d", "?")
    return Finding("libusb", Severity.OK, f"found; Open3D {open3d}")


def check_libraries(machine: Machine) -> Finding:
    """The other shared libraries that wheels expect from the system."""
    others = [library for library in SYSTEM_LIBRARIES if not library.soname.startswith("libusb")]
    return _missing_libraries(machine, "libraries", others) or Finding(
        "libraries", Severity.OK, ", ".join(library.soname.split(".so")[0] for library in others)
    )


def check_opencv(machine: Machine) -> Finding:
    """One OpenCV, older than 5."""
    installed = [name for name in _OPENCV if name in machine.versions]
    if len(installed) > 1:
        fact = f"{' and '.join(installed)} share one cv2 folder, so that the last one installed wins"
        cure = f"pip uninstall -y {' '.join(installed)} && pip install 'opencv-python>=4.10,<5'"
        return Finding("opencv", Severity.WARNING, fact, cure)
    if failure := _import_failure(machine, "opencv", "cv2"):
        return failure
    version = machine.versions[installed[0]] if installed else "?"
    if _numbers(version) >= (5,):
        fact = f"{version} has no hand-eye solvers, so that calibration does not work"
        return Finding("opencv", Severity.WARNING, fact, "pip install 'opencv-python>=4.10,<5'")
    return Finding("opencv", Severity.OK, version)


def check_mplib(machine: Machine) -> Finding:
    """NumPy 2 beside mplib, which ManiSkill installs: harmless until somebody imports mplib."""
    if failure := _import_failure(machine, "numpy", "numpy"):
        return failure
    numpy, mplib = machine.versions["numpy"], machine.versions.get("mplib")
    if mplib and _numbers(numpy) >= (2,):
        trap = f"mplib {mplib}, which ManiSkill brings, crashes with it: nothing here imports mplib, nor should you"
        return Finding("numpy", Severity.NOTE, f"{numpy}; {trap}")
    return Finding("numpy", Severity.OK, numpy)


def check_torchrl(machine: Machine) -> Finding:
    """TorchRL and the tensordict that belongs to it."""
    cure = "pip install -c constraints.txt torchrl tensordict"
    torchrl, tensordict = machine.versions.get("torchrl", "none"), machine.versions.get("tensordict", "none")
    pair = f"torchrl {torchrl}, tensordict {tensordict}"
    if _numbers(torchrl)[:2] != (0, 14) or _numbers(tensordict)[:2] != (0, 14):
        return Finding("torchrl", Severity.BROKEN, f"{pair} do not belong together here; wanted 0.14 of both", cure)
    for module in ("tensordict", "torchrl"):
        if failure := _import_failure(machine, "torchrl", module):
            return failure
    return Finding("torchrl", Severity.OK, pair)


def check_storage(machine: Machine) -> Finding:
    """The working folder can be written and has room."""
    if machine.write_error:
        cure = "run from a folder that belongs to you"
        return Finding("storage", Severity.BROKEN, f"cannot write to {machine.folder}: {machine.write_error}", cure)
    free = f"{machine.free_bytes / 1e9:.1f} GB free in {machine.folder}"
    if machine.free_bytes < 0.1e9:
        return Finding("storage", Severity.BROKEN, f"{free}: a checkpoint would not fit", "free at least 1 GB")
    if machine.free_bytes < 1e9:
        return Finding("storage", Severity.WARNING, f"{free}: a training run may not fit", "free at least 1 GB")
    return Finding("storage", Severity.OK, free)


def check_gpu(machine: Machine) -> Finding:
    """A GPU, if there is one, is one that torch uses."""
    if machine.torch_device:
        return Finding("gpu", Severity.OK, f"{machine.torch_device}; use it with --trainer.device cuda")
    if not machine.nvidia_gpu:
        return Finding("gpu", Severity.OK, "none; everything runs on the CPU")
    why = "its driver does not fit" if machine.torch_cuda else "torch is a CPU build"
    cure = "update the driver" if machine.torch_cuda else "pip install a torch that is built for CUDA"
    return Finding("gpu", Severity.WARNING, f"{machine.nvidia_gpu} is not used: {why}", cure)


def check_policy(machine: Machine) -> Finding:
    """The policies that come with the package are whole."""
    if not machine.policies:
        fact = "none is shipped with this copy, so that demo has nothing to show"
        return Finding("policy", Severity.WARNING, fact, "tr-grasp train grasp")
    broken = {name: lacking for name, lacking in machine.policies.items() if lacking}
    if broken:
        fact = "; ".join(f"{name} lacks {', '.join(lacking)}" for name, lacking in broken.items())
        return Finding("policy", Severity.BROKEN, fact, "git checkout -- tr_grasp/policies, or install again")
    return Finding("policy", Severity.OK, ", ".join(sorted(machine.policies)))


CHECKS: tuple[Callable[[Machine], Finding], ...] = (
    check_python,
    check_torch,
    check_torchrl,
    check_simulator,
    check_vulkan,
    check_libusb,
    check_libraries,
    check_opencv,
    check_mplib,
    check_gpu,
    check_storage,
    check_policy,
)


def _import_failure(machine: Machine, subject: str, module: str) -> Finding | None:
    if module not in machine.import_errors:
        return None
    error = machine.import_errors[module]
    # The loader names the library it misses; then apt knows better than pip.
    missing = next((library for library in SYSTEM_LIBRARIES if library.soname in error), None)
    cure = f"sudo apt-get install {missing.package}" if missing else _SETUP
    return Finding(subject, Severity.BROKEN, f"{module} cannot be imported: {error}", cure)


def _missing_libraries(machine: Machine, subject: str, libraries: Sequence[SystemLibrary]) -> Finding | None:
    missing = [library for library in libraries if library.soname in machine.missing_libraries]
    if not missing:
        return None
    severity = Severity.BROKEN if any(library.required for library in missing) else Severity.WARNING
    fact = "; ".join(f"no {library.soname}: {library.needed_by}" for library in missing)
    packages = " ".join(dict.fromkeys(library.package for library in missing))
    return Finding(subject, severity, fact, f"sudo apt-get install {packages}")


def _numbers(version: str) -> tuple[int, ...]:
    """``2.13.0+cpu`` as ``(2, 13, 0)``; nothing for ``none``."""
    release = re.match(r"\d+(\.\d+)*", version)
    return tuple(map(int, release.group().split("."))) if release else ()
