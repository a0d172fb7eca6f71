"""Many episodes in few numbers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from tr_grasp.errors import ConfigError
from tr_grasp.evaluation.records import EpisodeRecord
from tr_grasp.evaluation.statistics import Counts, Interval, MeanStd, mean_std, wilson_interval


@dataclass(frozen=True)
class SuiteSummary:
    """One suite, in the figures of the thesis' table."""

    suite: str
    """Its name."""
    success: Counts
    """Successful episodes."""
    interval: Interval
    """Wilson 95 % interval of the success rate."""
    reward: MeanStd
    """Sum of the rewards of an episode."""
    steps: MeanStd
    """Length of an episode."""
    steps_of_successes: MeanStd | None
    """Length of a successful episode; None without one."""
    outcomes: dict[str, int]
    """How often each end was met, the most frequent first."""

    def as_json(self) -> dict[str, Any]:
        """Plain dictionaries and numbers."""
        return {
            "suite": self.suite,
            "episodes": self.success.n,
            "successes": self.success.successes,
            "success_rate": self.success.rate,
            "wilson_95": list(self.interval),
            "reward": self.reward._asdict(),
            "steps": self.steps._asdict(),
            "steps_of_successes": self.steps_of_successes and self.steps_of_successes._asdict(),
            "outcomes": self.outcomes,
        }


def summarise(suite: str, records: Sequence[EpisodeRecord]) -> SuiteSummary:
    """Summary of the episodes of one suite.

    Raises:
        ConfigError: If there are none.
    """
    success = count(records)
    reward, steps = mean_std([r.reward for r in records]), mean_std([float(r.steps) for r in records])
    if reward is None or steps is None:
        raise ConfigError(f"suite {suite!r} has no finished episode to summarise.")
    return SuiteSummary(
        suite=suite,
        success=success,
        interval=wilson_interval(success),
        reward=reward,
        steps=steps,
        steps_of_successes=mean_std([float(r.steps) for r in records if r.success]),
        outcomes=dict(Counter(r.outcome for r in records).most_common()),
    )


def count(records: Iterable[EpisodeRecord]) -> Counts:
    """Successes among these episodes."""
    flags = [record.success for record in records]
    return Counts(sum(flags), len(flags))


def count_by(records: Iterable[EpisodeRecord], keys: Callable[[EpisodeRecord], Iterable[str]]) -> dict[str, Counts]:
    """Successes by a property of the episode, in the order of the property's name.

    Args:
        records: Episodes.
        keys: The groups to which an episode belongs; it counts once in each.
    """
    groups: dict[str, list[EpisodeRecord]] = {}
    for record in records:
        for key in dict.fromkeys(keys(record)):
            groups.setdefault(key, []).append(record)
    return {key: count(groups[key]) for key in sorted(groups)}


def by_family(records: Iterable[EpisodeRecord]) -> dict[str, Counts]:
    """Successes of the episodes in which an object of each family lay."""
    return count_by(records, lambda record: record.families)


def by_number(records: Iterable[EpisodeRecord]) -> dict[str, Counts]:
    """Successes by the number of objects."""
    return count_by(records, lambda record: [str(record.objects_n)])
