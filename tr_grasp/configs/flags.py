"""Settings on the command line: every flag is ``--path value``, every mistake one sentence."""

from __future__ import annotations

import contextlib
import dataclasses
import inspect
import io
import math
import types
from collections.abc import Iterator, Sequence
from itertools import chain, repeat
from pathlib import Path
from typing import Any, Literal, TypeVar, Union, get_args, get_origin

from tr_grasp.configs.build import coerce, leaf_types, nearest_path
from tr_grasp.errors import ConfigError, TrGraspError

T = TypeVar("T")

ALIASES = {"algorithm": "algorithm.name", "stack": "env.observation.stack_n"}
"""Short flags that are no setting's own name."""

SHORT_FLAGS = (
    "A flag may be as short as the last part of its path where no other setting ends like it (--encoder for "
    "--network.encoder), --stack is --env.observation.stack-n and --algorithm is --algorithm.name."
)


def parse(
    cfg_class: type[T],
    args: Sequence[str],
    default: T | None = None,
    *,
    prog: str | None = None,
    description: str | None = None,
) -> T:
    """Read settings from command-line arguments.

    Every field is one flag with its dotted path, hyphens and underscores alike, and takes a value:
    ``--env.observation.depth 5 --replay.symmetry-augmentation False``. The last part of a path is enough where no
    other path ends like it: ``--depth 5``; so are the names in ``ALIASES``.

    Args:
        cfg_class: Dataclass to fill; its docstrings are the ``--help``.
        args: Arguments after the verb.
        default: Values of the flags that are not given; without it, the class' own defaults.
        prog: Name shown in ``--help``.
        description: Text shown on top of ``--help``; the class' docstring by default.

    Raises:
        ConfigError: A flag that does not exist or could be several, a value that does not fit, or one that is missing.
        SystemExit: With code 0, after ``--help``.
    """
    import tyro  # not needed to read presets

    hints = dict(leaf_types(cfg_class))
    args = [_lengthen(hints, arg) if arg.startswith("--") else arg for arg in args]
    args = [_spell_booleans(hints, flag, value) for flag, value in _pairs(args)]
    description = description or inspect.getdoc(cfg_class)
    if any("." in path for path in hints):
        description = f"{description}\n\n{SHORT_FLAGS}"
    complaint = io.StringIO()
    try:
        with contextlib.redirect_stderr(complaint):
            cfg = tyro.cli(
                cfg_class,
                args=args,
                default=tyro.MISSING_NONPROP if default is None else default,
                prog=prog,
                description=description,
                config=(tyro.conf.FlagConversionOff, tyro.conf.PositionalMetavarFromFieldName),
            )
    except SystemExit as stop:
        if not stop.code:
            raise
        raise ConfigError(_explain(cfg_class, args, stop, complaint.getvalue())) from None
    _refuse_infinite(cfg)
    return cfg


def _lengthen(hints: dict[str, Any], flag: str) -> str:
    """A short flag, maybe with ``=value``, with the path that it stands for; any other as it is."""
    name, equals, value = flag.partition("=")
    short = _path(name)
    if short in hints or "." in short:
        return flag
    meant = [path for path in hints if path.rpartition(".")[2] == short]
    if ALIASES.get(short) in hints:
        meant = [ALIASES[short]]
    if len(meant) > 1:
        raise ConfigError(f"{name}: could be {' or '.join(f'--{path}' for path in meant)}; write one of them out")
    return f"--{meant[0]}{equals}{value}" if meant else flag


def _pairs(args: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Each argument with the flag before it, or with ''."""
    flag = ""
    for arg in args:
        yield flag, arg
        flag = arg if arg.startswith("--") else ""


def _spell_booleans(hints: dict[str, Any], flag: str, value: str) -> str:
    """``true`` and ``no`` as the ``True`` and ``False`` that the parser wants."""
    words = {"true": "True", "yes": "True", "on": "True", "false": "False", "no": "False", "off": "False"}
    return words.get(value.lower(), value) if hints.get(_path(flag)) is bool else value


def _path(flag: str) -> str:
    return flag.removeprefix("--").replace("-", "_")


def _explain(cfg_class: type, args: Sequence[str], stop: SystemExit, complaint: str) -> str:
    """One sentence for why the parser gave up."""
    cause: BaseException | None = stop
    while cause is not None:
        if isinstance(cause, TrGraspError):
            return str(cause)
        cause = cause.__cause__ or cause.__context__
    return _unknown_or_unfit(cfg_class, args) or _without_frame(complaint)


def _unknown_or_unfit(cfg_class: type, args: Sequence[str]) -> str | None:
    """The first flag that does not exist or whose values do not fit, in words."""
    hints = dict(leaf_types(cfg_class))
    for flag, texts in _flags(args):
        path = _path(flag)
        if path not in hints:
            return f"{flag}: {_unknown_flag(cfg_class, path)}"
        if not texts:
            return f"{flag}: needs a value"
        try:
            coerce(hints[path], _from_text(hints[path], texts), flag)
        except ConfigError as error:
            return str(error)
    return None


def _unknown_flag(cfg_class: type, path: str) -> str:
    near = nearest_path(cfg_class, path)
    names = [name for name, _ in leaf_types(cfg_class)]
    if near is not None:
        # A group is no flag by itself, so point at what is inside.
        return f"unknown; did you mean --{near if near in names else f'{near}.…'}?"
    return "unknown; see --help" if len(names) > 20 else f"unknown; valid: {', '.join(f'--{n}' for n in names)}"


def _flags(args: Sequence[str]) -> Iterator[tuple[str, list[str]]]:
    """Every ``--flag`` with the values up to the next one."""
    flag, texts = "", []
    for arg in args:
        if arg.startswith("--"):
            if flag:
                yield flag, texts
            flag, equals, text = arg.partition("=")
            texts = [text] if equals else []
        else:
            texts.append(arg)
    if flag:
        yield flag, texts


def _from_text(hint: Any, texts: list[str]) -> Any:
    """What the words mean for that type, or the words themselves where they mean nothing."""
    if get_origin(hint) is not tuple:
        return _scalar(hint, texts[0])
    kinds = get_args(hint)
    each = repeat(kinds[0]) if Ellipsis in kinds else chain(kinds, repeat(str))
    return [_scalar(kind, text) for kind, text in zip(each, texts, strict=False)]


def _scalar(hint: Any, text: str) -> Any:
    if get_origin(hint) in (Union, types.UnionType):
        readings = [_scalar(kind, text) for kind in get_args(hint)]
        return next((reading for reading in readings if not isinstance(reading, str)), text)
    if hint is type(None):
        return None if text == "None" else text
    if get_origin(hint) is Literal:
        return next((choice for choice in get_args(hint) if str(choice) == text), text)
    if hint is bool:
        return {"True": True, "False": False}.get(text, text)
    try:
        return hint(text) if hint in (int, float, Path) else text
    except ValueError:
        return text


def _refuse_infinite(cfg: Any, prefix: str = "--") -> None:
    for field in dataclasses.fields(cfg):
        value = getattr(cfg, field.name)
        if dataclasses.is_dataclass(value):
            _refuse_infinite(value, f"{prefix}{field.name}.")
        numbers = value if isinstance(value, tuple) else (value,)
        if any(isinstance(number, float) and not math.isfinite(number) for number in numbers):
            raise ConfigError(f"{prefix}{field.name}: must be finite, got {value}")


def _without_frame(complaint: str) -> str:
    """The parser's own words, without the box, its title and the pointer to ``--help``."""
    words: list[str] = []
    for line in complaint.splitlines():
        bare = line.strip("│╭╮╰╯ ")
        if line.startswith("╭"):
            continue
        if words and not bare.strip("─"):
            break
        words.append(bare)
    return " ".join(" ".join(words).split()) or "the arguments could not be read"
