"""Asking a real machine, and surviving what the answers do to the process that gives them."""

from __future__ import annotations

from pathlib import Path

import pytest

from tr_grasp.doctor.probe import probe, probe_imports, probe_vulkan


@pytest.fixture
def packages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder whose modules the probing processes import first."""
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    return tmp_path


def test_a_module_that_kills_the_process_is_named_and_the_others_are_still_asked(packages: Path) -> None:
    (packages / "deadly.py").write_text("import os, signal\nos.kill(os.getpid(), signal.SIGSEGV)\n")
    (packages / "sick.py").write_text(
        "print('{not json')\nraise ImportError('libusb-1.0.so.0: cannot open\\nsecond line')\n"
    )
    errors = probe_imports(["json", "deadly", "math", "sick", "absent"])
    assert errors == {
        "deadly": "the process was killed by signal 11",
        "sick": "ImportError: libusb-1.0.so.0: cannot open second line",
        "absent": "ModuleNotFoundError: No module named 'absent'",
    }


def test_a_module_that_leaves_is_named(packages: Path) -> None:
    (packages / "leaver.py").write_text("import os\nos._exit(3)\n")
    assert probe_imports(["leaver", "math"]) == {"leaver": "exit code 3"}


def test_a_renderer_that_crashes_is_a_missing_device(packages: Path) -> None:
    (packages / "sapien.py").write_text("import os\nos.abort()\n")
    assert probe_vulkan() == ("", "the process was killed by signal 6")


def test_a_renderer_without_driver_says_so(packages: Path) -> None:
    (packages / "sapien.py").write_text(
        "class render:\n    def RenderSystem():\n        raise RuntimeError('failed to find a rendering device')\n"
    )
    assert probe_vulkan() == ("", "failed to find a rendering device")


def test_the_name_of_the_device_is_read_from_the_summary(packages: Path) -> None:
    (packages / "sapien.py").write_text(
        "class render:\n    RenderSystem = object\n    get_device_summary = lambda: 'GPU: llvmpipe\\n  Supported: 1'\n"
    )
    assert probe_vulkan() == ("llvmpipe", "")


@pytest.mark.sim
def test_a_probe_of_this_machine_finds_what_runs_this_test(tmp_path: Path) -> None:
    machine = probe(tmp_path)
    assert machine.import_errors == {}
    assert machine.versions["torchrl"].startswith("0.14")
    assert machine.free_bytes > 0
    assert machine.write_error == ""
    assert bool(machine.vulkan_device) != bool(machine.vulkan_error)


def test_a_folder_that_is_not_there_cannot_be_written(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    from tr_grasp.doctor.probe import _free_bytes, _write_error

    assert _write_error(tmp_path / "absent") == "No such file or directory"
    assert _free_bytes(tmp_path / "absent") == 0
