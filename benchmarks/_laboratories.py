"""Measuring laboratory by laboratory, so that a stopped measurement goes on."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar

from tr_grasp.calibration.samples import SETUPS, Setup
from tr_grasp.files import make_folder, write_atomically

R = TypeVar("R")


def kept_runs(
    description: str | None, name: str, repetitions: int, record: type[R], measure: Callable[[Setup, int], Iterable[R]]
) -> list[R]:
    """Runs of all laboratories, by the program's flags; only those that its folder does not hold yet are measured.

    Args:
        description: What ``--help`` says.
        name: Of the folder under ``runs/benchmarks``, if ``--out`` is not given.
        repetitions: Laboratories of each setup, if ``--repetitions`` is not given.
        record: Dataclass of a run.
        measure: The runs of one laboratory, of a setup and a seed.
    """
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--out", type=Path, default=Path("runs/benchmarks") / name)
    parser.add_argument("--repetitions", type=int, default=repetitions)
    given = parser.parse_args()
    make_folder(given.out)
    runs: list[R] = []
    for seed in range(given.repetitions):
        for setup in SETUPS:
            path = given.out / f"{setup}_{seed}.json"
            if not path.exists():
                measured: list[Any] = list(measure(setup, seed))
                write_atomically(path, json.dumps([asdict(run) for run in measured]))
            runs += [record(**fields) for fields in json.loads(path.read_text(encoding="utf-8"))]
    return runs
