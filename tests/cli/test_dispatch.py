"""The command's front door: verbs, mistakes, exit codes."""

from __future__ import annotations

import subprocess
import sys
import warnings
from collections.abc import Callable
from types import SimpleNamespace

import pytest

import tr_grasp
import tr_grasp.cli as cli
from tr_grasp.errors import ConfigError


@pytest.fixture
def verb(monkeypatch: pytest.MonkeyPatch) -> Callable[[Callable[[list[str]], int]], None]:
    """Put a function in the place of ``tr-grasp doctor``."""

    def place(function: Callable[[list[str]], int]) -> None:
        monkeypatch.setitem(sys.modules, "tr_grasp.cli.doctor", SimpleNamespace(main=function))

    return place


@pytest.mark.parametrize("argv", [[], ["--help"], ["-h"], ["help"]])
def test_help_names_every_verb_with_one_line(argv: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(argv) == 0
    lines = capsys.readouterr().out.splitlines()
    for name, line in cli.VERBS.items():
        assert f"  {name:12} {line}" in lines


def test_the_version_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["--version"]) == 0
    assert capsys.readouterr().out == f"tr-grasp {tr_grasp.__version__}\n"


def test_a_verb_gets_its_arguments_and_gives_the_exit_code(verb: Callable) -> None:
    seen = []
    verb(lambda args: seen.append(args) or 7)
    assert cli.main(["doctor", "--a", "b"]) == 7
    assert seen == [["--a", "b"]]


def test_an_unknown_verb_gets_the_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["trian"]) == 2
    sentence = capsys.readouterr().err
    assert sentence.startswith("tr-grasp: unknown verb 'trian'; did you mean 'train'? Valid: calibrate, ")


def raises(error: BaseException) -> Callable[[list[str]], int]:
    def function(args: list[str]) -> int:
        raise error

    return function


@pytest.mark.parametrize(
    ("error", "code", "sentence"),
    [
        (ConfigError("--seed: needs a value"), 2, "--seed: needs a value"),
        (KeyboardInterrupt(), 130, "stopped by Ctrl-C"),
        (ImportError("libusb-1.0.so.0: absent"), 2, "libusb-1.0.so.0: absent; `tr-grasp doctor` says what is missing"),
    ],
)
def test_a_mistake_is_one_sentence_and_an_exit_code(
    verb: Callable, capsys: pytest.CaptureFixture[str], error: BaseException, code: int, sentence: str
) -> None:
    verb(raises(error))
    assert cli.main(["doctor"]) == code
    assert capsys.readouterr().err == f"tr-grasp: {sentence}\n"


def test_a_bug_keeps_its_traceback(verb: Callable) -> None:
    verb(raises(ZeroDivisionError()))
    with pytest.raises(ZeroDivisionError):
        cli.main(["doctor"])
    verb(raises(ModuleNotFoundError("No module named 'tr_grasp.x'", name="tr_grasp.x")))
    with pytest.raises(ModuleNotFoundError):
        cli.main(["doctor"])


def test_a_reader_that_leaves_early_is_no_error() -> None:
    code = "import sys, tr_grasp.cli as cli; sys.exit(cli.main(['--help']))"
    shell = subprocess.run(
        ["bash", "-c", 'set -o pipefail; "$0" -c "$1" | true', sys.executable, code],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (shell.returncode, shell.stderr) == (0, "")


def test_python_m_is_the_same_command() -> None:
    done = subprocess.run([sys.executable, "-m", "tr_grasp", "tarin"], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "did you mean 'train'?" in done.stderr


def test_listing_verbs_loads_nothing_heavy() -> None:
    code = (
        "import sys, tr_grasp.cli as cli; cli.main(['--help'])\n"
        "heavy = {'torch', 'numpy', 'yaml', 'tyro', 'sapien', 'mani_skill'} & set(sys.modules)\n"
        "sys.exit(', '.join(sorted(heavy)) or None)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_a_warning_of_ours_is_the_sentence_alone(verb: Callable, capsys: pytest.CaptureFixture[str]) -> None:
    class LeavesWarning(UserWarning):
        __module__ = "tr_grasp.octree"

    def warn(args: list[str]) -> int:
        warnings.warn("some leaves were left out", LeavesWarning, stacklevel=1)
        return 0

    verb(warn)
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        assert cli.main(["doctor"]) == 0
    assert capsys.readouterr().err == "tr-grasp: some leaves were left out\n"
