"""Settings as YAML: presets, the record of a run, and the command line on top of them.

A file holds only what differs from its parent::

    extends: grasp              # one preset, or a file beside this one
    env:
      objects:
        count_range: [1, 1]     # lists replace, they do not merge
    optimiser:
      learning_rate: 3e-4
"""

from __future__ import annotations

import re
from collections.abc import Hashable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import yaml

from tr_grasp.configs.build import build, plain
from tr_grasp.configs.flags import parse
from tr_grasp.configs.train import TrainCfg
from tr_grasp.errors import ConfigError, unknown_name

__all__ = ["dump_yaml", "load_cfg", "load_train_cfg", "parse", "preset_names", "read_yaml"]

T = TypeVar("T")

_PRESETS = Path(__file__).parent / "presets"
_EXTENDS = "extends"

# YAML 1.1, which PyYAML reads, takes 3e-4 and 1e6 for text because they lack a point or a sign.
_FLOAT = re.compile(r"^[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)[eE][-+]?[0-9]+$")


def load_train_cfg(name_or_path: str | Path) -> TrainCfg:
    """Read a training configuration.

    Args:
        name_or_path: A preset (``grasp``), a YAML file, or the folder of a run or policy (its ``config.yaml``).

    Raises:
        ConfigError: No such preset or file, not YAML, an unknown or repeated name, a value of the wrong type.
    """
    return load_cfg(TrainCfg(), name_or_path)


def load_cfg(default: T, name_or_path: str | Path) -> T:
    """As :func:`load_train_cfg`, for any settings: ``default`` with what the file and its parents change."""
    return _load(default, _find(name_or_path, beside=Path()), seen=())


def read_yaml(path: str | Path, name: str | None = None) -> Any:
    """What any YAML file holds: mappings, lists, numbers and text, nothing else.

    Args:
        path: The file.
        name: What errors call it; its path by default.

    Raises:
        ConfigError: It cannot be read, or is not YAML.
    """
    try:
        return yaml.load(Path(path).read_text(encoding="utf-8"), Loader=_Loader)
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{name or path}: cannot be read: {error}") from None
    except yaml.YAMLError as error:
        raise ConfigError(f"{name or path}: not YAML: {_one_line(error)}") from None


def preset_names() -> list[str]:
    """Names of the presets that come with the package."""
    return sorted(path.stem for path in _PRESETS.glob("*.yaml"))


def dump_yaml(cfg: Any) -> str:
    """All settings as YAML; loading the text gives the same settings back."""
    return yaml.dump(plain(cfg), Dumper=_Dumper, sort_keys=False, width=120)


def apply(default: T, delta: Mapping[str, Any], *, source: str, beside: Path, seen: tuple[Path, ...] = ()) -> T:
    """``default`` with what ``delta`` and the parent that it extends change.

    Args:
        default: Where the oldest parent starts from.
        delta: Settings by name, as read from YAML.
        source: What errors name as the place of the mistake.
        beside: Folder where the path of a parent starts.
        seen: Files on the way here, none of which may come again.

    Raises:
        ConfigError: As :func:`load_train_cfg`.
    """
    delta = dict(delta)
    parent = delta.pop(_EXTENDS, None)
    if parent is not None:
        if not isinstance(parent, str):
            raise ConfigError(f"{source}: {_EXTENDS}: must be the name of one preset or file, got {parent!r}")
        try:
            parent_path = _find(parent, beside=beside)
        except ConfigError as error:
            raise ConfigError(f"{source}: {_EXTENDS}: {error}") from None
        default = _load(default, parent_path, seen)
    return build(default, delta, source=source)


def _load(default: T, path: Path, seen: tuple[Path, ...]) -> T:
    source = _label(path)
    if path.resolve() in seen:
        raise ConfigError(f"{source}: extends itself, by way of {' and '.join(_label(parent) for parent in seen)}")
    return apply(default, read_mapping(path, source), source=source, beside=path.parent, seen=(*seen, path.resolve()))


def _find(name_or_path: str | Path, beside: Path) -> Path:
    """A preset of that name, else a file; ``beside`` is where relative paths start."""
    text = str(name_or_path)
    if text in preset_names():
        return _PRESETS / f"{text}.yaml"
    path = beside / text
    if (path / "config.yaml").is_file():
        return path / "config.yaml"
    if path.is_file():
        return path
    if Path(text).suffix or len(Path(text).parts) > 1:
        valid = ", ".join(preset_names())
        raise ConfigError(f"no settings at '{path}'; give a YAML file, a folder with config.yaml, or a preset: {valid}")
    raise ConfigError(f"{unknown_name('preset', text, preset_names())} A path to a YAML file works too.")


def _label(path: Path) -> str:
    return f"presets/{path.name}" if path.parent == _PRESETS else str(path)


def read_mapping(path: Path, source: str) -> dict[str, Any]:
    """The content of a YAML file, which must be names with values.

    Raises:
        ConfigError: It cannot be read, or is something else; the sentence begins with ``source``.
    """
    document = read_yaml(path, source)
    if document is None:
        return {}
    if not isinstance(document, dict):
        raise ConfigError(f"{source}: expected settings as 'name: value' lines, got {type(document).__name__}")
    return document


def _one_line(error: yaml.YAMLError) -> str:
    mark = getattr(error, "problem_mark", None)
    problem = getattr(error, "problem", None) or str(error)
    return f"line {mark.line + 1}: {problem}" if mark else " ".join(problem.split())


class _Loader(yaml.SafeLoader):
    """Safe YAML with the floats of YAML 1.2, and without repeated names."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        seen = set()
        for key in (key for key, _ in node.value if isinstance(key, yaml.ScalarNode)):
            if key.value in seen:
                problem = f"'{key.value}' is given twice"
                raise yaml.constructor.ConstructorError(problem=problem, problem_mark=key.start_mark)
            seen.add(key.value)
        return super().construct_mapping(node, deep)


class _Dumper(yaml.SafeDumper):
    """Writes short lists on one line, and quotes text that :class:`_Loader` would take for a number."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


for _class in (_Loader, _Dumper):
    _class.add_implicit_resolver("tag:yaml.org,2002:float", _FLOAT, list("-+.0123456789"))
_Dumper.add_representer(
    list, lambda dumper, items: dumper.represent_sequence("tag:yaml.org,2002:seq", items, flow_style=True)
)
