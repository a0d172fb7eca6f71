"""Is one policy better than another, or was it luck?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from tr_grasp.errors import ConfigError
from tr_grasp.evaluation.records import EpisodeRecord, by_suite
from tr_grasp.evaluation.statistics import (
    Counts,
    Interval,
    PairedCounts,
    difference_interval,
    episodes_needed,
    fisher_exact_test,
    mcnemar_exact_test,
    paired_difference_interval,
    paired_episodes_needed,
    two_proportion_z_test,
)
from tr_grasp.evaluation.summary import count

SIGNIFICANCE = 0.05
POWER = 0.8


@dataclass(frozen=True)
class Comparison:
    """Two policies on one suite. The difference is A minus B."""

    suite: str
    a: Counts
    b: Counts
    test: Literal["McNemar, exact", "Fisher, exact"]
    """McNemar's if both met the same scenes, else Fisher's."""
    p: float
    """Two-sided p-value of that test."""
    p_z: float
    """Two-sided p-value of the pooled z test, which takes the episodes as independent (for tables of other authors)."""
    interval: Interval
    """95 % interval of the difference of the success rates."""
    needed: int | None
    """Episodes of each policy that would show this difference at 5 % with 80 % power; None if there is none."""

    @property
    def difference(self) -> float:
        """Success rate of A minus that of B."""
        return self.a.rate - self.b.rate

    @property
    def is_significant(self) -> bool:
        """Whether p is below 5 %."""
        return self.p < SIGNIFICANCE

    @property
    def verdict(self) -> str:
        """One sentence."""
        if self.is_significant:
            better = "A" if self.difference > 0 else "B"
            return f"The difference is significant at 5 % (p = {self.p:.2g}): {better} is better."
        if self.needed is None:
            return "Neither is ahead, so no number of episodes would make this a difference."
        return (
            f"The difference is not significant at 5 % (p = {self.p:.2g}); if it is real, about {self.needed} episodes"
            f" of each would be needed to show it."
        )


def compare(a: Sequence[EpisodeRecord], b: Sequence[EpisodeRecord]) -> list[Comparison]:
    """Compare two evaluations, suite by suite.

    Episodes are paired if both evaluations met the same scenes: the same seeds with the same objects. If they share
    only some, those are compared and the rest is left out.

    Raises:
        ConfigError: If they have no suite in common.
    """
    in_a, in_b = by_suite(a), by_suite(b)
    shared = [suite for suite in in_a if suite in in_b]
    if not shared:
        raise ConfigError(
            f"A and B have no suite in common: A has {', '.join(in_a) or 'none'}, B has {', '.join(in_b) or 'none'}."
        )
    return [_compare_suite(suite, in_a[suite], in_b[suite]) for suite in shared]


def paired(a: Sequence[EpisodeRecord], b: Sequence[EpisodeRecord]) -> list[tuple[EpisodeRecord, EpisodeRecord]] | None:
    """Episodes of A and B in the same scenes; None if any shared seed led to other objects, or no seed is shared."""
    of_b = {record.seed: record for record in b}
    pairs = [(record, of_b[record.seed]) for record in a if record.seed in of_b]
    same = all(one.objects == other.objects for one, other in pairs)
    return pairs if pairs and same else None


def _compare_suite(suite: str, a: Sequence[EpisodeRecord], b: Sequence[EpisodeRecord]) -> Comparison:
    pairs = paired(a, b)
    return _compare_independent(suite, count(a), count(b)) if pairs is None else _compare_paired(suite, pairs)


def _compare_independent(suite: str, a: Counts, b: Counts) -> Comparison:
    return Comparison(
        suite=suite,
        a=a,
        b=b,
        test="Fisher, exact",
        p=fisher_exact_test(a, b),
        p_z=two_proportion_z_test(a, b),
        interval=difference_interval(a, b),
        needed=episodes_needed(a.rate, b.rate, alpha=SIGNIFICANCE, power=POWER),
    )


def _compare_paired(suite: str, pairs: Sequence[tuple[EpisodeRecord, EpisodeRecord]]) -> Comparison:
    a, b = count(one for one, _ in pairs), count(other for _, other in pairs)
    both = sum(one.success and other.success for one, other in pairs)
    cells = PairedCounts(
        both=both,
        only_a=a.successes - both,
        only_b=b.successes - both,
        neither=len(pairs) - a.successes - b.successes + both,
    )
    return Comparison(
        suite=suite,
        a=a,
        b=b,
        test="McNemar, exact",
        p=mcnemar_exact_test(cells),
        p_z=two_proportion_z_test(a, b),
        interval=paired_difference_interval(cells),
        needed=paired_episodes_needed(cells, alpha=SIGNIFICANCE, power=POWER),
    )
