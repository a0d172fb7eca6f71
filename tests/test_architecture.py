"""Imports go down only, simulators stay where they belong, and what is promised exists."""

from __future__ import annotations

import ast
import importlib
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

import tr_grasp

ROOT = Path(tr_grasp.__file__).parent
LAYERS = {
    6: ["cli", "__main__"],
    5: ["trainers", "evaluation"],
    4: ["envs"],
    3: ["modules", "dynamic", "pick_place", "deploy"],
    2: ["motion", "grasps", "prediction", "calibration", "hardware"],
    1: ["robots", "objects", "sensing", "octree"],
    0: ["configs", "geometry", "doctor", "errors", "files", "keys", "provenance", "__init__"],
}
LAYER = {name: layer for layer, names in LAYERS.items() for name in names}
SIMULATORS = {"sapien", "mani_skill"}
SIMULATOR_FILES = {
    "robots/agents.py",
    "robots/controller.py",
    "objects/actors.py",
    "sensing/sapien_bodies.py",
    "sensing/sapien_camera.py",
}
"""Files below the envs that may speak to the simulator: they build its actors, agents and cameras."""


class Import(NamedTuple):
    """One imported module and the file, relative to the package, that imports it."""

    importer: Path
    target: str

    def __repr__(self) -> str:
        return f"{self.importer.as_posix()} imports {self.target}"


def imports_of(source: str, path: Path) -> Iterator[Import]:
    """Every import in a file, those inside functions included; relative ones made absolute."""
    package = ["tr_grasp", *path.parts[:-1]]
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            targets = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            module = ".".join([*base, *filter(None, [node.module])])
            # `from tr_grasp import envs` imports a package as much as `import tr_grasp.envs` does.
            targets = [f"tr_grasp.{alias.name}" for alias in node.names] if module == "tr_grasp" else [module]
        else:
            continue
        yield from (Import(path, target) for target in targets)


def package_of(path: Path) -> str:
    return path.parts[0] if len(path.parts) > 1 else path.stem


def layer_of(path: Path) -> int:
    """Layer of a file; below all others where the table does not know it, which a test reports."""
    return LAYER.get(package_of(path), -1)


def target_package(target: str) -> str | None:
    """``octree`` for ``tr_grasp.octree.build``; nothing for other libraries; names of ``__init__`` are itself."""
    head, *rest = target.split(".")
    if head != "tr_grasp":
        return None
    return rest[0] if rest and rest[0] in LAYER else "__init__"


def upward(imports: list[Import]) -> list[Import]:
    """Imports from a layer that is higher than one's own."""
    return [
        found
        for found in imports
        if (target := target_package(found.target)) and LAYER[target] > layer_of(found.importer)
    ]


def misplaced_simulators(imports: list[Import]) -> list[Import]:
    """Simulator imports outside the envs, what is above them, and the files that build simulated things."""
    return [
        found
        for found in imports
        if found.target.split(".")[0] in SIMULATORS
        and layer_of(found.importer) < LAYER["envs"]
        and found.importer.as_posix() not in SIMULATOR_FILES
    ]


def misplaced(imports: list[Import], library: str, allowed: set[str]) -> list[Import]:
    return [
        found for found in imports if found.target.split(".")[0] == library and found.importer.as_posix() not in allowed
    ]


def cycle(imports: list[Import]) -> list[str]:
    """Packages that import each other in a ring; empty if there is none."""
    edges: dict[str, set[str]] = {}
    for found in imports:
        source, target = package_of(found.importer), target_package(found.target)
        # The root package only holds the version, and everything may ask for that.
        if target and target not in (source, "__init__"):
            edges.setdefault(source, set()).add(target)

    def search(trail: list[str], done: set[str]) -> list[str]:
        for target in sorted(edges.get(trail[-1], ())):
            if target in trail:
                return [*trail[trail.index(target) :], target]
            if target not in done and (ring := search([*trail, target], done)):
                return ring
        done.add(trail[-1])
        return []

    done: set[str] = set()
    return next((ring for start in sorted(edges) if (ring := search([start], done))), [])


def files() -> list[Path]:
    return sorted(path.relative_to(ROOT) for path in ROOT.rglob("*.py"))


ALL = [found for path in files() for found in imports_of((ROOT / path).read_text(encoding="utf-8"), path)]


def test_every_package_has_a_layer() -> None:
    assert {package_of(path) for path in files()} <= set(LAYER)


def test_imports_go_down_only() -> None:
    assert upward(ALL) == []


def test_no_packages_import_each_other_in_a_ring() -> None:
    assert cycle(ALL) == []


def test_simulators_are_imported_where_they_belong() -> None:
    assert misplaced_simulators(ALL) == []


def test_yaml_is_read_in_one_file() -> None:
    assert misplaced(ALL, "yaml", {"configs/io.py"}) == []


def test_torchrl_is_used_from_the_modules_upwards() -> None:
    low = {path.as_posix() for path in files() if layer_of(path) >= LAYER["modules"]}
    assert misplaced(ALL, "torchrl", low) == []


@pytest.mark.parametrize("library", ["mplib", "ocnn", "stable_baselines3", "sb3_contrib"])
def test_a_library_that_serves_tests_or_crashes_is_never_imported(library: str) -> None:
    assert misplaced(ALL, library, set()) == []


def test_only_the_command_line_prints() -> None:
    printing = [
        f"{path.as_posix()}:{node.lineno}"
        for path in files()
        if package_of(path) != "cli"
        for node in ast.walk(ast.parse((ROOT / path).read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "print"
    ]
    assert printing == []


def modules(lowest: int, highest: int) -> list[str]:
    """Importable names of the files in these layers; simulator files and the command's entry left out."""
    names = []
    for path in files():
        if not lowest <= layer_of(path) <= highest or path.as_posix() in SIMULATOR_FILES | {"__main__.py"}:
            continue
        parts = ["tr_grasp", *path.with_suffix("").parts]
        names.append(".".join(parts[:-1] if parts[-1] == "__init__" else parts))
    return names


@pytest.mark.sim
@pytest.mark.parametrize("name", modules(0, 6))
def test_every_name_that_a_module_promises_exists(name: str) -> None:
    module = importlib.import_module(name)
    promised = getattr(module, "__all__", [])
    assert [word for word in promised if not hasattr(module, word)] == []
    assert len(set(promised)) == len(promised)


def loaded_by(names: list[str]) -> set[str]:
    """Top-level modules in a fresh interpreter after importing these."""
    code = (
        f"import sys\nfor name in {names!r}: __import__(name)\nprint(*{{name.split('.')[0] for name in sys.modules}})"
    )
    done = subprocess.run([sys.executable, "-W", "ignore", "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return set(done.stdout.splitlines()[-1].split())


def test_the_lower_layers_load_no_simulator() -> None:
    assert loaded_by(modules(0, 3)) & (SIMULATORS | {"mplib"}) == set()


def test_importing_the_package_loads_nothing_heavy() -> None:
    assert loaded_by(["tr_grasp"]) & (SIMULATORS | {"torch", "numpy", "torchrl", "open3d"}) == set()


@pytest.mark.parametrize(
    ("path", "source"),
    [
        ("octree/build.py", "from tr_grasp.modules import build_agent"),
        ("grasps/x.py", "def f():\n    import tr_grasp.envs.grasp"),
        ("errors.py", "from tr_grasp import cli"),
        ("modules/x.py", "from ..trainers import train"),
        ("sensing/x.py", "from tr_grasp.grasps.top_down import y"),
    ],
)
def test_an_import_upwards_is_noticed(path: str, source: str) -> None:
    assert len(upward(list(imports_of(source, Path(path))))) == 1


@pytest.mark.parametrize(
    ("path", "source"),
    [
        ("envs/x.py", "from tr_grasp.octree import OctreeSpec\nfrom tr_grasp import __version__\nimport torch"),
        ("trainers/x.py", "from tr_grasp.evaluation import rollouts"),
        ("modules/encoders/x.py", "from ..build import y\nfrom . import z"),
    ],
)
def test_an_import_downwards_or_beside_is_fine(path: str, source: str) -> None:
    assert upward(list(imports_of(source, Path(path)))) == []


def test_a_misplaced_simulator_is_noticed() -> None:
    source = "import sapien.render\nfrom mani_skill.envs import x"
    assert len(misplaced_simulators(list(imports_of(source, Path("sensing/raycast.py"))))) == 2
    assert misplaced_simulators(list(imports_of(source, Path("sensing/sapien_camera.py")))) == []
    assert misplaced_simulators(list(imports_of(source, Path("envs/grasp.py")))) == []


def test_a_ring_is_noticed() -> None:
    there = list(imports_of("from tr_grasp.octree import x", Path("sensing/a.py")))
    back = list(imports_of("from tr_grasp.sensing import y", Path("octree/b.py")))
    assert cycle(there) == []
    assert cycle(there + back) == ["octree", "sensing", "octree"]
