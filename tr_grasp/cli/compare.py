"""``tr-grasp compare``: is one evaluation better than another?"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from tyro.conf import Positional

from tr_grasp.cli.table import text_table
from tr_grasp.configs.io import parse
from tr_grasp.evaluation.comparison import Comparison, compare
from tr_grasp.evaluation.records import read_episodes
from tr_grasp.evaluation.statistics import Counts

HEAD = ("suite", "A", "B", "A - B", "95 % interval", "p", "test", "p (z test)")


@dataclass(frozen=True)
class CompareCfg:
    """Say whether the difference between two evaluations is more than luck.

    Episodes of the same seeds and objects are compared as pairs.
    """

    a: Positional[Path]
    """Folder or CSV file of one evaluation."""

    b: Positional[Path]
    """Folder or CSV file of the other."""


def main(args: list[str]) -> int:
    """Run the verb."""
    cfg = parse(CompareCfg, args, prog="tr-grasp compare")
    comparisons = compare(read_episodes(cfg.a), read_episodes(cfg.b))
    print(f"A  {cfg.a}\nB  {cfg.b}\n")
    print(text_table(HEAD, [row(comparison) for comparison in comparisons]))
    print()
    for comparison in comparisons:
        print(f"{comparison.suite}: {comparison.verdict}")
    if len(comparisons) > 1:
        print(f"({len(comparisons)} suites were tested; the p-values are not corrected for that.)")
    return 0


def row(comparison: Comparison) -> tuple[str, ...]:
    """The cells of ``HEAD``."""
    low, high = comparison.interval
    return (
        comparison.suite,
        _share(comparison.a),
        _share(comparison.b),
        f"{100 * comparison.difference:+.1f} %",
        f"{100 * low:+.1f} to {100 * high:+.1f} %",
        f"{comparison.p:.2g}",
        comparison.test,
        f"{comparison.p_z:.2g}",
    )


def _share(counts: Counts) -> str:
    return f"{100 * counts.rate:.1f} % of {counts.n}"
