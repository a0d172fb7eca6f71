"""What the runs of a study say: success of each, differences to the first one, curves."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from tr_grasp.evaluation.comparison import Comparison, compare
from tr_grasp.evaluation.records import EpisodeRecord
from tr_grasp.evaluation.statistics import Counts, wilson_interval
from tr_grasp.evaluation.summary import count

SUMMARY_HEAD = ("run", "success", "95 % interval", "each seed", "minus the first", "p", "test")
_SEEDS_APART = 10**9
Point = tuple[float, float]


@dataclass(frozen=True)
class Trained:
    """One run of a study, trained and judged.

    Attributes:
        label: Which of the study's runs.
        seed: Its training seed.
        records: The episodes by which it was judged.
        curve: (environment steps, success) of the evaluations while it was trained.
    """

    label: str
    seed: int
    records: Sequence[EpisodeRecord]
    curve: Sequence[Point]


def read_curve(progress_csv: Path) -> list[Point]:
    """The evaluations in a run's ``progress.csv``."""
    with progress_csv.open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row.get("evaluation/success")]
    return [(float(row["env_steps"]), float(row["evaluation/success"])) for row in rows]


def by_label(trained: Sequence[Trained]) -> dict[str, list[Trained]]:
    """The seeds of each run, in order of appearance."""
    groups: dict[str, list[Trained]] = {}
    for run in trained:
        groups.setdefault(run.label, []).append(run)
    return groups


def summary_rows(trained: Sequence[Trained]) -> list[tuple[str, ...]]:
    """The cells of ``SUMMARY_HEAD``, one row a run, its seeds pooled."""
    groups = by_label(trained)
    first = next(iter(groups.values()))
    return [_row(label, runs, None if runs is first else _difference(runs, first)) for label, runs in groups.items()]


def curves_png(trained: Sequence[Trained], title: str) -> bytes:
    """Success while training: a line through the mean of the seeds, a band from the worst to the best."""
    figure = Figure(figsize=(7.6, 4.2), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    for index, (label, runs) in enumerate(by_label(trained).items()):
        shared = sorted(set.intersection(*({steps for steps, _ in run.curve} for run in runs)))
        if not shared:
            continue
        columns = [[dict(run.curve)[steps] for run in runs] for steps in shared]
        colour = mpl.colormaps["tab10"](index % 10)
        axes.plot(shared, [sum(column) / len(column) for column in columns], "o-", color=colour, label=label)
        axes.fill_between(shared, list(map(min, columns)), list(map(max, columns)), color=colour, alpha=0.15)
    axes.set(title=title, xlabel="environment steps", ylabel="success in validation", ylim=(0, 1))
    axes.yaxis.set_major_formatter(PercentFormatter(1.0))
    axes.grid(alpha=0.3)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(frameon=False)
    stream = io.BytesIO()
    figure.savefig(stream, dpi=140, format="png")
    return stream.getvalue()


def as_json(trained: Sequence[Trained]) -> dict[str, Mapping[str, float]]:
    """Success of each run and seed, as ``{label: {seed: rate}}``."""
    return {
        label: {str(run.seed): count(run.records).rate for run in runs} for label, runs in by_label(trained).items()
    }


def _row(label: str, runs: Sequence[Trained], against: Comparison | None) -> tuple[str, ...]:
    counts = _pooled(runs)
    low, high = wilson_interval(counts)
    each = ", ".join(f"{100 * count(run.records).rate:.0f}" for run in runs)
    row = (label, f"{100 * counts.rate:.1f} %", f"{100 * low:.1f} to {100 * high:.1f} %", each)
    if against is None:
        return (*row, "", "", "")
    return (*row, f"{100 * against.difference:+.1f} %", f"{against.p:.2g}", against.test)


def _pooled(runs: Sequence[Trained]) -> Counts:
    return count(record for run in runs for record in run.records)


def _difference(runs: Sequence[Trained], first: Sequence[Trained]) -> Comparison:
    (comparison,) = compare(_one_suite(runs), _one_suite(first))
    return comparison


def _one_suite(runs: Sequence[Trained]) -> list[EpisodeRecord]:
    """All episodes, told apart by training seed too, so that each is paired with its twin of the same one."""
    return [
        replace(record, suite="all", seed=record.seed + _SEEDS_APART * run.seed)
        for run in runs
        for record in run.records
    ]
