"""Asking the machine. Whatever might crash is asked in a process of its own."""

from __future__ import annotations

import importlib.metadata
import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import tr_grasp
from tr_grasp.doctor.machine import SYSTEM_LIBRARIES, Machine

MODULES = ("numpy", "cv2", "open3d", "sapien", "torch", "tensordict", "torchrl", "mani_skill.envs")
POLICY_FILES = ("policy.safetensors", "config.yaml", "training.json")

_TIMEOUT_S = 180.0  # the first import after an installation compiles everything

_IMPORT = """
import importlib, json, sys, warnings
warnings.simplefilter("ignore")
for name in sys.argv[1:]:
    print(json.dumps({"trying": name}), flush=True)
    try:
        importlib.import_module(name)
    except BaseException as problem:
        print(json.dumps({"failed": name, "why": f"{type(problem).__name__}: {problem}"}), flush=True)
"""
_TORCH = """
import json, torch
device = torch.cuda.get_device_name() if torch.cuda.is_available() else ""
print(json.dumps({"cuda": torch.version.cuda or "", "device": device}))
"""
_VULKAN = """
import json, warnings
warnings.simplefilter("ignore")
import sapien
try:
    sapien.render.RenderSystem()
    summary = sapien.render.get_device_summary()
    print(json.dumps({"device": summary.partition("GPU:")[2].splitlines()[0].strip() or "unnamed"}))
except Exception as problem:
    print(json.dumps({"error": str(problem)}))
"""
_LIBRARIES = """
import ctypes, json, sys
for name in sys.argv[1:]:
    try:
        ctypes.CDLL(name)
    except OSError:
        print(json.dumps({"missing": name}), flush=True)
"""


def probe(folder: Path | None = None) -> Machine:
    """Collect the facts; takes a few seconds because it imports every heavy dependency once.

    Args:
        folder: Working folder to look at; the current one by default.
    """
    folder = (folder or Path()).resolve()
    with ThreadPoolExecutor() as pool:
        import_errors = pool.submit(probe_imports, MODULES)
        torch = pool.submit(_ask, _TORCH)
        vulkan = pool.submit(probe_vulkan)
        libraries = pool.submit(probe_libraries)
    torch_facts = _first(torch.result()[0], "cuda")
    vulkan_device, vulkan_error = vulkan.result()
    return Machine(
        python=sys.version_info[:3],
        versions=_installed_versions(),
        import_errors=import_errors.result(),
        missing_libraries=libraries.result(),
        torch_cuda=torch_facts.get("cuda", ""),
        torch_device=torch_facts.get("device", ""),
        nvidia_gpu=_nvidia_gpu(),
        vulkan_device=vulkan_device,
        vulkan_error=vulkan_error,
        folder=folder,
        write_error=_write_error(folder),
        free_bytes=_free_bytes(folder),
        policies=_shipped_policies(),
    )


def probe_imports(modules: Sequence[str]) -> dict[str, str]:
    """Import modules in a process of its own; the ones that fail, or kill it, with the reason."""
    errors: dict[str, str] = {}
    while modules:
        answers, end = _ask(_IMPORT, *modules)
        errors |= {answer["failed"]: _one_line(answer["why"]) for answer in answers if "failed" in answer}
        tried = [answer["trying"] for answer in answers if "trying" in answer]
        if not end:
            break
        if not tried:
            return errors | dict.fromkeys(modules, end)
        errors[tried[-1]] = end
        modules = modules[len(tried) :]
    return errors


def probe_vulkan() -> tuple[str, str]:
    """Name of the device that SAPIEN can draw with, and otherwise why there is none."""
    answers, end = _ask(_VULKAN)
    return _first(answers, "device").get("device", ""), _first(answers, "error").get("error", end)


def probe_libraries() -> frozenset[str]:
    """Sonames of system libraries that the loader does not find; empty on systems other than Linux."""
    if sys.platform != "linux":
        return frozenset()
    answers, _ = _ask(_LIBRARIES, *(library.soname for library in SYSTEM_LIBRARIES))
    return frozenset(answer["missing"] for answer in answers if "missing" in answer)


def _ask(code: str, *arguments: str) -> tuple[list[dict[str, str]], str]:
    """Run Python code; the JSON objects that it printed, and how it ended if not well."""
    try:
        done = subprocess.run(
            [sys.executable, "-c", code, *arguments],
            capture_output=True,
            text=True,
            errors="replace",
            timeout=_TIMEOUT_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return [], f"no answer within {_TIMEOUT_S:.0f} s"
    answers = [json.loads(line) for line in done.stdout.splitlines() if line.startswith('{"')]
    if done.returncode < 0:
        return answers, f"the process was killed by signal {-done.returncode}"
    last_words = done.stderr.strip().splitlines()[-1:] or [f"exit code {done.returncode}"]
    return answers, _one_line(last_words[0]) if done.returncode else ""


def _first(answers: list[dict[str, str]], key: str) -> dict[str, str]:
    return next((answer for answer in answers if key in answer), {})


def _one_line(text: str) -> str:
    return " ".join(text.split())[:200]


def _installed_versions() -> dict[str, str]:
    found = ((dist.metadata["Name"], dist.version) for dist in importlib.metadata.distributions())
    return {name.lower().replace("_", "-"): version for name, version in found if name}


def _nvidia_gpu() -> str:
    command = shutil.which("nvidia-smi")
    if command is None:
        return ""
    query = [command, "--query-gpu=name", "--format=csv,noheader"]
    try:
        done = subprocess.run(query, capture_output=True, text=True, timeout=20, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return next(iter(done.stdout.splitlines()), "").strip() if done.returncode == 0 else ""


def _write_error(folder: Path) -> str:
    try:
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(b"tr_grasp")
    except OSError as error:
        return error.strerror or str(error)
    return ""


def _free_bytes(folder: Path) -> int:
    try:
        return shutil.disk_usage(folder).free
    except OSError:
        return 0


def _shipped_policies() -> dict[str, tuple[str, ...]]:
    folders = (Path(tr_grasp.__file__).parent / "policies").glob("[!_.]*/")
    return {
        folder.name: tuple(name for name in POLICY_FILES if not (folder / name).is_file())
        for folder in folders
        if folder.is_dir()
    }
