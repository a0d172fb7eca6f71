"""Every fault of a machine, made up, and what the doctor says about it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from tr_grasp.doctor import CHECKS, SYSTEM_LIBRARIES, Machine, Severity, examine

HEALTHY = Machine(
    python=(3, 11, 7),
    versions={
        "torch": "2.13.0+cpu",
        "torchrl": "0.14.1",
        "tensordict": "0.14.3",
        "sapien": "3.0.3",
        "mani-skill": "3.0.1",
        "open3d-cpu": "0.20.0",
        "opencv-python": "4.14.0.94",
        "numpy": "2.4.6",
    },
    import_errors={},
    vulkan_device="llvmpipe",
    folder=Path("project"),
    free_bytes=50 * 10**9,
    policies={"panda": ()},
)


def versions(**changes: str | None) -> Machine:
    changed = HEALTHY.versions | {name.replace("_", "-"): version for name, version in changes.items()}
    return replace(HEALTHY, versions={name: version for name, version in changed.items() if version})


def broken_import(module: str, why: str = "ImportError: it is not there") -> Machine:
    return replace(HEALTHY, import_errors={module: why})


FAULTS = {
    "python too old": (
        replace(HEALTHY, python=(3, 9, 18)),
        "python",
        Severity.BROKEN,
        "3.9.18 is outside",
        "PYTHON=python3.11",
    ),
    "python too new": (
        replace(HEALTHY, python=(3, 13, 0)),
        "python",
        Severity.BROKEN,
        "3.13.0 is outside",
        "scripts/setup.sh",
    ),
    "torch missing": (broken_import("torch"), "torch", Severity.BROKEN, "torch cannot be imported", "scripts/setup.sh"),
    "torch old": (
        versions(torch="2.6.1"),
        "torch",
        Severity.BROKEN,
        "2.6.1 is older than 2.7",
        "constraints.txt torch",
    ),
    "torch for CUDA without GPU": (
        replace(versions(torch="2.13.0"), torch_cuda="13.0"),
        "torch",
        Severity.WARNING,
        "no NVIDIA GPU",
        "TR_GRASP_TORCH_INDEX",
    ),
    "torchrl of another year": (
        versions(torchrl="0.13.0"),
        "torchrl",
        Severity.BROKEN,
        "torchrl 0.13.0",
        "constraints.txt",
    ),
    "tensordict too new": (
        versions(tensordict="0.15.3"),
        "torchrl",
        Severity.BROKEN,
        "tensordict 0.15.3",
        "constraints.txt",
    ),
    "tensordict missing": (versions(tensordict=None), "torchrl", Severity.BROKEN, "tensordict none", "constraints.txt"),
    "torchrl cannot be imported": (
        broken_import("torchrl"),
        "torchrl",
        Severity.BROKEN,
        "cannot be imported",
        "setup.sh",
    ),
    "sapien missing": (broken_import("sapien"), "simulator", Severity.BROKEN, "sapien cannot be imported", "setup.sh"),
    "sapien lacks a library": (
        broken_import("sapien", "ImportError: libX11.so.6: cannot open shared object file"),
        "simulator",
        Severity.BROKEN,
        "libX11.so.6",
        "sudo apt-get install libx11-6",
    ),
    "mani_skill missing": (
        broken_import("mani_skill.envs"),
        "simulator",
        Severity.BROKEN,
        "mani_skill.envs",
        "setup.sh",
    ),
    "no Vulkan": (
        replace(HEALTHY, vulkan_device="", vulkan_error="failed to find a rendering device"),
        "vulkan",
        Severity.WARNING,
        "the ray-cast camera does the work",
        "mesa-vulkan-drivers",
    ),
    "no libusb": (
        replace(broken_import("open3d"), missing_libraries=frozenset({"libusb-1.0.so.0"})),
        "libusb",
        Severity.BROKEN,
        "no libusb-1.0.so.0: Open3D",
        "sudo apt-get install libusb-1.0-0",
    ),
    "open3d missing": (broken_import("open3d"), "libusb", Severity.BROKEN, "open3d cannot be imported", "setup.sh"),
    "no GL and no glib": (
        replace(HEALTHY, missing_libraries=frozenset({"libGL.so.1", "libglib-2.0.so.0", "libgthread-2.0.so.0"})),
        "libraries",
        Severity.BROKEN,
        "no libGL.so.1: OpenCV and Open3D",
        "sudo apt-get install libgl1 libglib2.0-0",
    ),
    "no gomp": (
        replace(HEALTHY, missing_libraries=frozenset({"libgomp.so.1"})),
        "libraries",
        Severity.WARNING,
        "no libgomp.so.1",
        "sudo apt-get install libgomp1",
    ),
    "no Xext": (
        replace(HEALTHY, missing_libraries=frozenset({"libXext.so.6"})),
        "libraries",
        Severity.WARNING,
        "no libXext.so.6: pictures by a Vulkan driver",
        "sudo apt-get install libxext6",
    ),
    "OpenCV 5": (versions(opencv_python="5.0.0.93"), "opencv", Severity.WARNING, "no hand-eye solvers", ">=4.10,<5"),
    "two OpenCVs": (
        versions(opencv_python_headless="4.14.0.94"),
        "opencv",
        Severity.WARNING,
        "opencv-python and opencv-python-headless share one cv2",
        "pip uninstall -y opencv-python opencv-python-headless &&",
    ),
    "OpenCV missing": (broken_import("cv2"), "opencv", Severity.BROKEN, "cv2 cannot be imported", "setup.sh"),
    "mplib beside NumPy 2": (versions(mplib="0.1.1"), "numpy", Severity.NOTE, "mplib 0.1.1", ""),
    "NumPy missing": (broken_import("numpy"), "numpy", Severity.BROKEN, "numpy cannot be imported", "setup.sh"),
    "GPU unused by a CPU build": (
        replace(HEALTHY, nvidia_gpu="RTX 4090"),
        "gpu",
        Severity.WARNING,
        "RTX 4090 is not used: torch is a CPU build",
        "CUDA",
    ),
    "GPU with a bad driver": (
        replace(HEALTHY, nvidia_gpu="RTX 4090", torch_cuda="13.0"),
        "gpu",
        Severity.WARNING,
        "its driver does not fit",
        "update the driver",
    ),
    "folder not writable": (
        replace(HEALTHY, write_error="Permission denied"),
        "storage",
        Severity.BROKEN,
        "cannot write to project: Permission denied",
        "a folder that belongs to you",
    ),
    "disk nearly full": (replace(HEALTHY, free_bytes=5 * 10**8), "storage", Severity.WARNING, "0.5 GB free", "1 GB"),
    "disk full": (replace(HEALTHY, free_bytes=10**6), "storage", Severity.BROKEN, "0.0 GB free", "1 GB"),
    "no policy": (replace(HEALTHY, policies={}), "policy", Severity.WARNING, "none is shipped", "tr-grasp train grasp"),
    "policy torn": (
        replace(HEALTHY, policies={"panda": ("policy.safetensors",)}),
        "policy",
        Severity.BROKEN,
        "panda lacks policy.safetensors",
        "git checkout",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_named_with_its_cure(fault: str) -> None:
    machine, subject, severity, fact, cure = FAULTS[fault]
    finding = next(finding for finding in examine(machine) if finding.subject == subject)
    assert finding.severity is severity
    assert fact in finding.fact
    assert cure in finding.cure
    assert "\n" not in finding.fact + finding.cure


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_found_by_one_check_alone(fault: str) -> None:
    machine, subject, *_ = FAULTS[fault]
    assert {finding.subject for finding in examine(machine) if finding.severity is not Severity.OK} == {subject}


def test_a_healthy_machine_passes_every_check() -> None:
    assert [finding for finding in examine(HEALTHY) if finding.severity is not Severity.OK or finding.cure] == []


def test_a_machine_with_a_gpu_that_torch_uses_passes_too() -> None:
    machine = replace(versions(torch="2.13.0"), torch_cuda="13.0", torch_device="H100", nvidia_gpu="H100")
    assert {finding.severity for finding in examine(machine)} == {Severity.OK}


def test_every_check_has_a_fault_that_it_finds() -> None:
    assert {subject for _, subject, *_ in FAULTS.values()} == {finding.subject for finding in examine(HEALTHY)}
    assert len(CHECKS) == len(examine(HEALTHY))


@pytest.mark.parametrize("library", SYSTEM_LIBRARIES, ids=lambda library: library.soname)
def test_every_system_library_that_is_missing_is_named_with_its_package(library: object) -> None:
    findings = examine(replace(HEALTHY, missing_libraries=frozenset({library.soname})))
    [finding] = [finding for finding in findings if finding.severity is not Severity.OK]
    assert library.soname in finding.fact
    assert library.package in finding.cure


def test_a_broken_machine_is_still_examined_to_the_end() -> None:
    nothing = Machine(
        python=(3, 8, 0), versions={}, import_errors=dict.fromkeys(("torch", "numpy", "cv2", "open3d"), "no")
    )
    nothing = replace(nothing, import_errors=nothing.import_errors | {"sapien": "no", "mani_skill.envs": "no"})
    assert len(examine(nothing)) == len(CHECKS)
