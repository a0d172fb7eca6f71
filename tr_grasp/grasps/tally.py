"""Counts of tries that survive an interruption."""

from __future__ import annotations

import io
import time
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tr_grasp.files import write_atomically
from tr_grasp.grasps.poses import Grasps
from tr_grasp.grasps.trial import TryGrasps

if TYPE_CHECKING:
    from tr_grasp.grasps.build import Progress

AT_ONCE = 96
STAGES = {"screening": 2, "ranking": 3}
"""Number of each stage, which seeds its misplacements."""


@dataclass
class Tally:
    """How often each of n grasps was tried, and how often it held.

    Attributes:
        stage: Which stage of the build.
        key: What is being built.
        rounds: How often each grasp is to be tried.
        file: Where it is kept after every round, with the stage's name; nowhere if not given.
        successes, tries: (n,) so far.
        rounds_done: Whole rounds so far.
        seconds: Spent so far, interruptions left out.
    """

    stage: str
    key: str
    rounds: int
    file: Path | None
    successes: NDArray[np.int64]
    tries: NDArray[np.int64]
    rounds_done: int = 0
    seconds: float = 0.0

    @classmethod
    def of(cls, stage: str, key: str, n: int, rounds: int, file: Path | None) -> Tally:
        """A tally as its file says, if that is of the same build; else an empty one."""
        own = None if file is None else _file_of(file, stage)
        tally = cls(stage, key, rounds, own, np.zeros(n, np.int64), np.zeros(n, np.int64))
        tally._take_up()
        return tally

    def run(
        self, grasps: Grasps, try_grasps: TryGrasps, seed: int, progress: Progress, *, drop_below: float = 0.0
    ) -> None:
        """Try all that are still in it, round by round.

        Args:
            grasps: The n grasps.
            try_grasps: Tries each once.
            seed: With stage and round, of the misplacements.
            progress: Told how far it is.
            drop_below: Whoever can no longer reach this success rate is left out of further rounds.
        """
        allowed = self.rounds - int(np.ceil(drop_below * self.rounds - 1e-9))
        while self.rounds_done < self.rounds:
            started = time.monotonic()
            rng = np.random.default_rng([seed, STAGES[self.stage], self.rounds_done])
            alive = np.flatnonzero(self.tries - self.successes <= allowed)
            if not len(alive):
                return
            for start in range(0, len(alive), AT_ONCE):
                chosen = alive[start : start + AT_ONCE]
                progress(self.stage, self.rounds_done * len(alive) + start, self.rounds * len(alive))
                self.successes[chosen] += try_grasps(grasps.subset(chosen), rng)
            self.tries[alive] += 1
            self.rounds_done += 1
            self.seconds += time.monotonic() - started
            self._keep()
            progress(self.stage, self.rounds_done * len(alive), self.rounds * len(alive))

    def _keep(self) -> None:
        if self.file is None:
            return
        content = io.BytesIO()
        np.savez(
            content, key=self.key, successes=self.successes, tries=self.tries, rounds=self.rounds_done,
            seconds=self.seconds,
        )  # fmt: skip
        write_atomically(self.file, content.getvalue())

    def _take_up(self) -> None:
        if self.file is None or not self.file.is_file():
            return
        try:
            with np.load(self.file, allow_pickle=False) as kept:
                same = str(kept["key"]) == self.key and len(kept["tries"]) == len(self.tries)
                if same:
                    self.successes, self.tries = kept["successes"].copy(), kept["tries"].copy()
                    self.rounds_done, self.seconds = int(kept["rounds"]), float(kept["seconds"])
        # A tally can be made again, so one that cannot be read is no reason to stop.
        except (OSError, ValueError, KeyError, zipfile.BadZipFile):
            return


def forget_tally(file: Path) -> None:
    """Remove what a build kept beside its ``resume_file``."""
    for stage in STAGES:
        _file_of(file, stage).unlink(missing_ok=True)


def _file_of(file: Path, stage: str) -> Path:
    return file.with_name(f"{file.name}.{stage}.npz")
