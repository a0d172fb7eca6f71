"""What verbs share on the command line: flags beside those of the settings, parts, files to write."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from tr_grasp.errors import ConfigError, unknown_name
from tr_grasp.files import make_folder


def take(args: list[str], flag: str, what: str) -> tuple[str | None, list[str]]:
    """The value of a flag, and the arguments without it.

    Args:
        args: What follows the verb.
        flag: ``--like-this``; an underscore is as good as a hyphen.
        what: What its value is, for the error.

    Raises:
        ConfigError: The flag stands there without a value.
    """
    for index, arg in enumerate(args):
        name, equals, value = arg.partition("=")
        if name.replace("_", "-") != flag:
            continue
        if equals:
            return value, [*args[:index], *args[index + 1 :]]
        if index + 1 == len(args) or args[index + 1].startswith("--"):
            raise ConfigError(f"{flag} needs {what}.")
        return args[index + 1], [*args[:index], *args[index + 2 :]]
    return None, args


def whole_number(text: str | None, flag: str, default: int) -> int:
    """A value of :func:`take` as a number of at least 1.

    Raises:
        ConfigError: It is none.
    """
    if text is None:
        return default
    if not text.isdecimal() or int(text) < 1:
        raise ConfigError(f"{flag} must be a whole number of at least 1, got {text}.")
    return int(text)


def device_settings(texts: tuple[str, ...]) -> dict[str, str]:
    """Settings of devices, as ``name=value``.

    Raises:
        ConfigError: One of them has no name or no value.
    """
    pairs = [text.partition("=") for text in texts]
    for text, (name, _, value) in zip(texts, pairs, strict=True):
        if not name or not value:
            raise ConfigError(f"--device must be name=value, such as arm_host=192.168.0.10, got {text!r}.")
    return {name: value for name, _, value in pairs}


def run_part(verb: str, parts: Mapping[str, Callable[[list[str]], int]], args: list[str], help_text: str) -> int:
    """Run the part of a verb that the first argument names; without one, say which there are.

    Raises:
        ConfigError: There is no such part.
    """
    part, *rest = args or ["--help"]
    if part in ("-h", "--help", "help"):
        print(help_text)
        return 0
    if part not in parts:
        raise ConfigError(f"{unknown_name(f'verb of {verb}', part, parts)} Try `tr-grasp {verb} --help`.")
    return parts[part](rest)


def make_room(out: Path) -> None:
    """Make the folder of a file that is to be written.

    Raises:
        ConfigError: The file is there already.
        StorageError: The folder cannot be made.
    """
    if out.exists():
        raise ConfigError(f"--out: {out} is there already; name another file or remove it.")
    make_folder(out.parent)
