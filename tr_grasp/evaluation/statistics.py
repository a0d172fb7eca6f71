"""How sure a success rate is, and whether two of them differ."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from scipy.stats import binomtest, fisher_exact, norm


class Interval(NamedTuple):
    """A confidence interval."""

    low: float
    high: float


class MeanStd(NamedTuple):
    """Mean and population standard deviation, as the thesis and Stable-Baselines3 report them."""

    mean: float
    std: float


class Counts(NamedTuple):
    """Successes out of a number of episodes."""

    successes: int
    n: int

    @property
    def rate(self) -> float:
        """Share of successes; NaN without episodes."""
        return self.successes / self.n if self.n else math.nan


class PairedCounts(NamedTuple):
    """Two policies on the same episodes: how often only one, both or neither succeeded."""

    both: int
    only_a: int
    only_b: int
    neither: int

    @property
    def n(self) -> int:
        """Number of episode pairs."""
        return sum(self)


def mean_std(values: Sequence[float]) -> MeanStd | None:
    """Mean and population standard deviation; None for no values."""
    if not values:
        return None
    mean = math.fsum(values) / len(values)
    return MeanStd(mean, math.sqrt(math.fsum((v - mean) ** 2 for v in values) / len(values)))


def wilson_interval(counts: Counts, confidence: float = 0.95) -> Interval:
    """Interval of a success rate that stays inside [0, 1] and is right for few episodes too.

    Without episodes nothing is known: (0, 1).

    Source: Wilson 1927, doi:10.1080/01621459.1927.10502953.
    """
    if counts.n == 0:
        return Interval(0.0, 1.0)
    interval = binomtest(counts.successes, counts.n).proportion_ci(confidence, method="wilson")
    return Interval(float(interval.low), float(interval.high))


def two_proportion_z_test(a: Counts, b: Counts) -> float:
    """Two-sided p-value of equal success rates, normal approximation with the pooled variance."""
    if a.n == 0 or b.n == 0:
        return 1.0
    pooled = (a.successes + b.successes) / (a.n + b.n)
    variance = pooled * (1 - pooled) * (1 / a.n + 1 / b.n)
    if variance == 0:
        return 1.0
    return float(2 * norm.sf(abs(a.rate - b.rate) / math.sqrt(variance)))


def fisher_exact_test(a: Counts, b: Counts) -> float:
    """Two-sided exact p-value of equal success rates; right for few episodes, a little cautious."""
    table = [[a.successes, a.n - a.successes], [b.successes, b.n - b.successes]]
    return float(fisher_exact(table).pvalue)


def difference_interval(a: Counts, b: Counts, confidence: float = 0.95) -> Interval:
    """Interval of ``a.rate - b.rate`` for independent episodes.

    Source: Newcombe 1998, method 10, doi:10.1002/(SICI)1097-0258(19980430)17:8<873::AID-SIM779>3.0.CO;2-I.
    """
    if a.n == 0 or b.n == 0:
        return Interval(-1.0, 1.0)
    in_a, in_b = wilson_interval(a, confidence), wilson_interval(b, confidence)
    difference = a.rate - b.rate
    return Interval(
        difference - math.hypot(a.rate - in_a.low, in_b.high - b.rate),
        difference + math.hypot(in_a.high - a.rate, b.rate - in_b.low),
    )


def mcnemar_exact_test(pairs: PairedCounts) -> float:
    """Two-sided exact p-value that both policies succeed equally often on the same episodes.

    Only the episodes on which they disagree count; with none, p is 1.

    Source: McNemar 1947, doi:10.1007/BF02295996.
    """
    disagreements = pairs.only_a + pairs.only_b
    return float(binomtest(pairs.only_a, disagreements).pvalue) if disagreements else 1.0


def paired_difference_interval(pairs: PairedCounts, confidence: float = 0.95) -> Interval:
    """Interval of ``rate_a - rate_b`` on the same episodes: Wald's, with one more disagreement each way.

    Source: Bonett and Price 2012, doi:10.3102/1076998611411915.
    """
    n = pairs.n + 2
    share_a, share_b = (pairs.only_a + 1) / n, (pairs.only_b + 1) / n
    centre = share_a - share_b
    half = float(norm.ppf((1 + confidence) / 2)) * math.sqrt((share_a + share_b - centre**2) / n)
    return Interval(max(-1.0, centre - half), min(1.0, centre + half))


def episodes_needed(rate_a: float, rate_b: float, *, alpha: float = 0.05, power: float = 0.8) -> int | None:
    """Independent episodes of each policy with which Fisher's test shows this difference with probability ``power``.

    Returns:
        None if the rates are equal: no number of episodes shows a difference that is not there.

    Source: Fleiss, Levin and Paik 2003, *Statistical Methods for Rates and Proportions*, eq. 4.14 and 4.15.
    """
    if rate_a == rate_b:
        return None
    difference, mean = abs(rate_a - rate_b), (rate_a + rate_b) / 2
    z_alpha, z_power = _normal_quantiles(alpha, power)
    spread = z_alpha * math.sqrt(2 * mean * (1 - mean))
    spread += z_power * math.sqrt(rate_a * (1 - rate_a) + rate_b * (1 - rate_b))
    of_z_test = (spread / difference) ** 2
    return math.ceil(of_z_test / 4 * (1 + math.sqrt(1 + 4 / (of_z_test * difference))) ** 2)


def paired_episodes_needed(pairs: PairedCounts, *, alpha: float = 0.05, power: float = 0.8) -> int | None:
    """Shared episodes with which McNemar's test shows this difference with probability ``power``.

    Returns:
        None if each policy wins equally often where they disagree.

    Source: Connor 1987, doi:10.2307/2531961.
    """
    if pairs.only_a == pairs.only_b:
        return None
    difference = (pairs.only_a - pairs.only_b) / pairs.n
    disagreement = (pairs.only_a + pairs.only_b) / pairs.n
    z_alpha, z_power = _normal_quantiles(alpha, power)
    spread = z_alpha * math.sqrt(disagreement) + z_power * math.sqrt(disagreement - difference**2)
    # With fewer disagreements than this, even a clean sweep has an exact p-value above alpha.
    sweep = math.ceil(1 - math.log2(alpha))
    return math.ceil(max((spread / difference) ** 2, sweep / disagreement))


def _normal_quantiles(alpha: float, power: float) -> tuple[float, float]:
    return float(norm.ppf(1 - alpha / 2)), float(norm.ppf(power))
