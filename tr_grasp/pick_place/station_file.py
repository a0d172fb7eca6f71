"""Reads a station from YAML; every mistake is one sentence with its place."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from tr_grasp.configs.build import build
from tr_grasp.configs.io import read_mapping
from tr_grasp.errors import ConfigError, unknown_name
from tr_grasp.pick_place.station import BoxCfg, PoseCfg, StageCfg, StationCfg

T = TypeVar("T")
_SHIPPED = Path(__file__).parent / "stations"
_ANY_POSE = PoseCfg((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))


def station_names() -> list[str]:
    """Stations that come with the package."""
    return sorted(path.stem for path in _SHIPPED.glob("*.yaml"))


def read_station(name_or_path: str | Path) -> StationCfg:
    """A station that comes with the package, or your own file.

    Args:
        name_or_path: ``thesis``, or the path of a YAML file.

    Raises:
        ConfigError: No such station, not YAML, a name or value that does not fit.
    """
    text = str(name_or_path)
    if text in station_names():
        return station_from(read_mapping(_SHIPPED / f"{text}.yaml", f"stations/{text}.yaml"), f"stations/{text}.yaml")
    path = Path(text)
    if not path.suffix and len(path.parts) == 1:
        raise ConfigError(f"{unknown_name('station', text, station_names())} The path of a YAML file works too.")
    return station_from(read_mapping(path, text), text)


def station_from(content: Mapping[str, Any], source: str) -> StationCfg:
    """A station from plain data.

    Raises:
        ConfigError: A name or value that does not fit; the sentence begins with ``source``.
    """
    plain = dict(content)
    poses = {name: _pose(value, f"{source}: poses.{name}") for name, value in _group(plain, "poses", source).items()}
    boxes = {
        name: _one(BoxCfg(), value, f"{source}: boxes.{name}") for name, value in _group(plain, "boxes", source).items()
    }
    stages = tuple(_one(StageCfg("-", "open"), value, where) for where, value in _rows(plain, "stages", source))
    try:
        # Poses, boxes and stages belong together; the rest is checked against them.
        whole = StationCfg(poses=poses, boxes=boxes, stages=stages)
    except ConfigError as error:
        raise ConfigError(f"{source}: {error}") from None
    return build(whole, plain, source=source)


def _pose(value: Any, where: str) -> PoseCfg:
    derived = isinstance(value, Mapping) and "like" in value
    if not derived and not (isinstance(value, Mapping) and {"position_m", "orientation_xyzw"} <= set(value)):
        raise ConfigError(f"{where}: must have position_m and orientation_xyzw, or like, got {value!r}")
    return _one(PoseCfg(like="-") if derived else _ANY_POSE, value, where)


def _one(base: T, value: Any, where: str) -> T:
    names = [field.name for field in dataclasses.fields(base)]  # type: ignore[arg-type]
    if isinstance(value, Mapping) and (wrong := [name for name in value if name not in names]):
        raise ConfigError(f"{where}: {unknown_name('name', str(wrong[0]), names)}")
    return build(base, value, source=where)


def _group(plain: dict[str, Any], name: str, source: str) -> Mapping[str, Any]:
    group = plain.pop(name, {})
    if not isinstance(group, Mapping):
        raise ConfigError(f"{source}: {name}: expected 'name: value' lines, got {group!r}")
    return group


def _rows(plain: dict[str, Any], name: str, source: str) -> list[tuple[str, Any]]:
    rows = plain.pop(name, [])
    if not isinstance(rows, list):
        raise ConfigError(f"{source}: {name}: expected a list, got {rows!r}")
    for i, row in enumerate(rows):
        if not isinstance(row, Mapping) or "name" not in row or "do" not in row:
            raise ConfigError(f"{source}: {name}[{i}]: expected a name and what to do, got {row!r}")
    return [(f"{source}: {name}[{i}]", row) for i, row in enumerate(rows)]
