"""From plain data (mappings, lists, numbers) to frozen settings and back, strictly.

Every error names the source, the dotted path and what would have been right, so that a typo in a
file of eighty settings is found in one reading.
"""

from __future__ import annotations

import dataclasses
import math
import types
from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from tr_grasp.errors import ConfigError

T = TypeVar("T")


def build(base: T, delta: Mapping[str, Any], *, source: str = "settings") -> T:
    """A copy of ``base`` in which the named fields have new values.

    Args:
        base: Frozen dataclass instance, which may hold others.
        delta: Field names to plain values; nested settings are mappings, tuples are lists.
        source: Where ``delta`` was written, for error messages.

    Raises:
        ConfigError: A field that does not exist, a value of the wrong type or outside its choices,
            or whatever the settings' own checks refuse.
    """
    return _build(base, delta, source=source, prefix="", root=type(base))


def _build(base: Any, delta: Any, *, source: str, prefix: str, root: type) -> Any:
    if delta is None and prefix:
        return base  # a group whose lines are all commented out
    if not isinstance(delta, Mapping):
        where = f"{prefix.rstrip('.')}: " if prefix else ""
        raise ConfigError(f"{source}: {where}expected settings as 'name: value' lines, got {delta!r}")
    hints = field_types(type(base))
    changes = {}
    for name, value in delta.items():
        path = f"{prefix}{name}"
        if name not in hints:
            raise ConfigError(f"{source}: {path}: {_unknown(root, path)}")
        if dataclasses.is_dataclass(hints[name]):
            changes[name] = _build(getattr(base, name), value, source=source, prefix=f"{path}.", root=root)
        else:
            changes[name] = coerce(hints[name], value, f"{source}: {path}")
    try:
        return dataclasses.replace(base, **changes)
    except ConfigError as error:
        raise ConfigError(f"{source}: {error}") from None


def coerce(hint: Any, value: Any, where: str) -> Any:
    """``value`` as the annotated type, or an error that says what was expected.

    Whole numbers become floats where a float is wanted and lists become tuples; nothing else is converted.

    Raises:
        ConfigError: ``{where}: must be ..., got ...``.
    """
    origin = get_origin(hint)
    if origin is tuple:
        return _coerce_tuple(hint, value, where)
    if origin in (Union, types.UnionType):
        return _coerce_optional(hint, value, where)
    if not _is_valid(hint, value):
        raise ConfigError(f"{where}: must be {describe(hint)}, got {value!r}{_nearest_choice(hint, value)}")
    return hint(value) if hint in (float, Path) else value


def describe(hint: Any) -> str:
    """The type in words: ``one of 'actor', 'critic'``, ``a number``, ``3 values, each a number``."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is Literal:
        return f"one of {', '.join(repr(choice) for choice in arguments)}"
    if origin is tuple:
        many = arguments[-1] is Ellipsis
        return f"a list, each {describe(arguments[0])}" if many else f"a list of {len(arguments)} values"
    if origin in (Union, types.UnionType):
        return " or ".join("nothing" if argument is type(None) else describe(argument) for argument in arguments)
    words = {bool: "true or false", int: "a whole number", float: "a finite number", str: "text", Path: "a path"}
    return words.get(hint, getattr(hint, "__name__", str(hint)))


def plain(cfg: Any) -> Any:
    """Settings as dictionaries, lists and scalars, in the order of their fields."""
    if dataclasses.is_dataclass(cfg):
        return {field.name: plain(getattr(cfg, field.name)) for field in dataclasses.fields(cfg)}
    if isinstance(cfg, tuple):
        return [plain(item) for item in cfg]
    return str(cfg) if isinstance(cfg, Path) else cfg


def field_types(cfg_class: Any) -> dict[str, Any]:
    """Annotated type of each field, with annotations resolved and ``Annotated`` stripped."""
    hints = get_type_hints(cfg_class)
    return {field.name: hints[field.name] for field in dataclasses.fields(cfg_class)}


def leaf_types(cfg_class: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted path and type of every setting that is not itself a group of settings."""
    for name, hint in field_types(cfg_class).items():
        if dataclasses.is_dataclass(hint):
            yield from leaf_types(hint, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", hint


def nearest_path(root: type, path: str) -> str | None:
    """The dotted path that was probably meant, if any.

    A near miss among the neighbours comes first; then the same name elsewhere in the tree, which
    catches ``objects.split`` written for ``env.objects.split``; then whatever is spelt alike.
    """
    parent, dot, name = path.rpartition(".")
    if near := get_close_matches(name, _names_below(root, parent), n=1, cutoff=0.6):
        return f"{parent}{dot}{near[0]}"
    paths = _all_paths(root)
    same_end = [candidate for candidate in paths if f".{candidate}".endswith(f".{path}")]
    same_name = [candidate for candidate in paths if candidate.rpartition(".")[2] == name]
    alike = get_close_matches(path, paths, n=1, cutoff=0.75)
    return next(iter([*same_end, *same_name, *alike]), None)


def _unknown(root: type, path: str) -> str:
    parent = path.rpartition(".")[0]
    near = nearest_path(root, path)
    if near is None:
        return f"unknown; valid names here: {', '.join(_names_below(root, parent)) or 'none'}"
    near_parent, _, near_name = near.rpartition(".")
    return f"unknown; did you mean {near_name if near_parent == parent else near}?"


def _names_below(root: type, parent: str) -> list[str]:
    """Fields of the group at a dotted path; none if there is no such group."""
    group = root
    for name in filter(None, parent.split(".")):
        group = field_types(group).get(name)
        if not dataclasses.is_dataclass(group):
            return []
    return list(field_types(group))


def _all_paths(root: type) -> list[str]:
    """Dotted paths of all settings and of all groups."""
    paths: dict[str, None] = {}
    for leaf, _ in leaf_types(root):
        parts = leaf.split(".")
        paths |= dict.fromkeys(".".join(parts[:n]) for n in range(1, len(parts) + 1))
    return list(paths)


def _is_valid(hint: Any, value: Any) -> bool:
    if get_origin(hint) is Literal:
        # 1 == True, so compare types too.
        return any(value == choice and type(value) is type(choice) for choice in get_args(hint))
    if hint is float:
        return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    if hint is int:
        return isinstance(value, int) and not isinstance(value, bool)
    if hint is Path:
        return isinstance(value, str | Path)
    return isinstance(value, hint)


def _coerce_tuple(hint: Any, value: Any, where: str) -> tuple[Any, ...]:
    arguments = get_args(hint)
    if not isinstance(value, list | tuple):
        raise ConfigError(f"{where}: must be {describe(hint)}, got {value!r}")
    if arguments[-1] is Ellipsis:
        arguments = (arguments[0],) * len(value)
    if len(value) != len(arguments):
        raise ConfigError(f"{where}: must be {describe(hint)}, got {len(value)}: {list(value)!r}")
    return tuple(
        coerce(argument, item, f"{where}[{index}]")
        for index, (argument, item) in enumerate(zip(arguments, value, strict=True))
    )


def _coerce_optional(hint: Any, value: Any, where: str) -> Any:
    if value is None and type(None) in get_args(hint):
        return None
    for argument in get_args(hint):
        if argument is type(None):
            continue
        try:
            return coerce(argument, value, where)
        except ConfigError:
            continue
    raise ConfigError(f"{where}: must be {describe(hint)}, got {value!r}")


def _nearest_choice(hint: Any, value: Any) -> str:
    if get_origin(hint) is not Literal:
        return ""
    near = get_close_matches(str(value), [str(choice) for choice in get_args(hint)], n=1)
    return f"; did you mean {near[0]}?" if near else ""
