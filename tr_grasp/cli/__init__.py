"""The command ``tr-grasp``: one verb, one file, imported when it is called."""

from __future__ import annotations

import importlib
import os
import sys
import warnings
from collections.abc import Sequence
from typing import Any

import tr_grasp
from tr_grasp.errors import TrGraspError, unknown_name

VERBS = {
    "doctor": "say what this machine lacks, and the cure",
    "demo": "let the shipped policy grasp objects that it has never seen",
    "train": "train a policy from a preset or a YAML file",
    "evaluate": "judge a policy on held-out objects and write a report",
    "compare": "say whether one evaluation is better than another",
    "study": "train and judge the runs that answer one question (the thesis' comparisons, or yours)",
    "grasps": "find, try and rank grasps of an object, show them, try them again",
    "reachability": "learn where an arm's tool can be, show it, ask at a pose",
    "play": "let an agent play, and film it: zero, random, scripted or a policy",
    "demos": "record demonstrations of the scripted expert, look at them, export them (LeRobot)",
    "predict": "train and judge predictors of where a moving object will be",
    "dynamic": "grasp objects that move on unknown paths: tables beside the thesis', films",
    "export": "write a policy as one file that runs without this package (ONNX, torch.export)",
    "run": "let a policy grasp on a station, simulated or real, with a guard and a log that can be played again",
    "pick-place": "carry an object from one taught pose to another, in simulation or on real devices",
    "calibrate": "find where a camera is, seen from a robot: board, collection, solution, report",
}
"""Every verb with its one line of help; verb ``x`` lives in ``tr_grasp.cli.x``."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run a verb.

    Args:
        argv: Verb and its arguments; those of the process by default.

    Returns:
        The exit code: the verb's own, 2 for a mistake that has been explained, 130 after Ctrl-C.
    """
    verb, *args = list(sys.argv[1:] if argv is None else argv) or ["--help"]
    try:
        with warnings.catch_warnings():  # whoever calls this twice finds them as they were
            _silence_missing_vulkan()
            _say_own_warnings_plainly()
            code = _run(verb, args)
        sys.stdout.flush()
        return code
    except TrGraspError as error:
        return _say(str(error), 2)
    except KeyboardInterrupt:
        return _say("stopped by Ctrl-C", 130)
    except BrokenPipeError:
        # The reader went away (`| head`); keep the interpreter from complaining when it flushes.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0


def _run(verb: str, args: list[str]) -> int:
    if verb in ("-h", "--help", "help"):
        print(_help())
        return 0
    if verb == "--version":
        print(f"tr-grasp {tr_grasp.__version__}")
        return 0
    if verb not in VERBS:
        return _say(f"{unknown_name('verb', verb, VERBS)} Try `tr-grasp --help`.", 2)
    try:
        return importlib.import_module(f"tr_grasp.cli.{verb.replace('-', '_')}").main(args)
    except ImportError as error:
        # One of ours that is missing is a bug and deserves its traceback.
        if isinstance(error, TrGraspError) or (error.name or "").startswith("tr_grasp"):
            raise
        return _say(f"{error}; `tr-grasp doctor` says what is missing", 2)


def _silence_missing_vulkan() -> None:
    # SAPIEN warns about it in every process; nothing here needs it, and `doctor` says so once.
    message = "Failed to find system libvulkan"
    warnings.filterwarnings("ignore", message=message)
    others = os.environ.get("PYTHONWARNINGS")
    os.environ["PYTHONWARNINGS"] = f"{others + ',' if others else ''}ignore:{message}"


def _say_own_warnings_plainly() -> None:
    # A user wants the sentence, not the file and line that it came from.
    show = warnings.showwarning

    def say(message: Warning | str, category: type[Warning], *place: Any) -> None:
        if category.__module__.startswith("tr_grasp"):
            _say(str(message), 0)
        else:
            show(message, category, *place)

    warnings.showwarning = say


def _help() -> str:
    verbs = "\n".join(f"  {verb:12} {line}" for verb, line in VERBS.items())
    return (
        f"usage: tr-grasp VERB ...\n\n{tr_grasp.__doc__}\n\nverbs:\n{verbs}\n\n"
        "`tr-grasp VERB --help` lists the flags of a verb; `tr-grasp --version` tells the version."
    )


def _say(sentence: str, code: int) -> int:
    print(f"tr-grasp: {sentence}", file=sys.stderr)
    return code
