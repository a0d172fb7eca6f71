"""A progress bar for episodes."""

from __future__ import annotations

import sys

from tqdm import tqdm

from tr_grasp.evaluation.records import EpisodeRecord


class EpisodeBar:
    """Episodes done, time left and success so far, on stderr; use it as a context manager."""

    def __init__(self, episodes_n: int) -> None:
        # A log file is not a terminal: there, every refresh is a line of its own.
        pause_s = 0.2 if sys.stderr.isatty() else 10.0
        self._bar = tqdm(total=episodes_n, desc="starting", unit="episode", mininterval=pause_s, dynamic_ncols=True)
        self._done = self._successes = 0

    def __enter__(self) -> EpisodeBar:
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.close()

    def update(self, record: EpisodeRecord) -> None:
        """Count one episode."""
        self._done += 1
        self._successes += record.success
        self._bar.set_description(record.suite, refresh=False)
        self._bar.set_postfix_str(f"success {100 * self._successes / self._done:.0f} %", refresh=False)
        self._bar.update()
