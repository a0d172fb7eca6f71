"""The report's plots. Each is drawn for light and for dark pages."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, PercentFormatter

from tr_grasp.evaluation.records import EpisodeRecord, by_suite
from tr_grasp.evaluation.statistics import Counts, wilson_interval


@dataclass(frozen=True)
class Theme:
    """Colours of a page."""

    text: str
    muted: str
    grid: str
    good: str
    bad: str
    series: tuple[str, ...]


LIGHT = Theme("#1c2534", "#5b6779", "#dfe4ec", "#2f9e66", "#d2584e", ("#3b6fd4", "#d98324", "#7d57c1", "#2b9aa0"))
DARK = Theme("#e4e9f1", "#98a4b6", "#344054", "#4cc38a", "#ef7d72", ("#7ea6f7", "#f0ab5c", "#b196ee", "#62c6cb"))

_FEWEST_ROWS = 3

Draw = Callable[[Axes, Theme], None]


@dataclass(frozen=True, eq=False)
class Plot:
    """A plot that can be drawn in any theme."""

    title: str
    draw: Draw
    rows_n: int = 5
    """Rows of a bar chart; sets the height."""
    is_wide: bool = False
    """Take the whole width of the page."""

    def png(self, theme: Theme, dots_per_inch: int = 160) -> bytes:
        """Draw it on a transparent ground."""
        width_in, row_in = (11.2, 0.26) if self.is_wide else (5.4, 0.34)
        figure = Figure(figsize=(width_in, max(2.3, 0.75 + row_in * self.rows_n)), layout="constrained")
        FigureCanvasAgg(figure)
        with mpl.rc_context(_style(theme)):
            axes = figure.subplots()
            self.draw(axes, theme)
        stream = io.BytesIO()
        figure.savefig(stream, dpi=dots_per_inch, transparent=True, format="png")
        return stream.getvalue()


def plots_of(
    records: Sequence[EpisodeRecord], by_family: Mapping[str, Counts], by_number: Mapping[str, Counts]
) -> list[Plot]:
    """All plots of an evaluation."""
    suites = by_suite(records)
    rates = {name: Counts(sum(r.success for r in group), len(group)) for name, group in suites.items()}
    reasons = {r.outcome for r in records if not r.success}
    return [
        Plot("Success by suite, with 95 % interval", lambda axes, theme: draw_rates(axes, theme, rates), len(rates)),
        Plot("Success by number of objects", lambda axes, theme: draw_rates(axes, theme, by_number), len(by_number)),
        Plot("Why episodes failed", lambda axes, theme: draw_failures(axes, theme, suites), len(reasons)),
        Plot("Length of episodes", lambda axes, theme: draw_lengths(axes, theme, records)),
        Plot(
            "Success where a family was present",
            lambda axes, theme: draw_rates(axes, theme, by_family),
            len(by_family),
            is_wide=True,
        ),
    ]


def draw_rates(axes: Axes, theme: Theme, rates: Mapping[str, Counts]) -> None:
    """Success rates as dots with their Wilson intervals, the first on top."""
    rows = np.arange(len(rates))
    for row, counts in zip(rows, rates.values(), strict=True):
        low, high = wilson_interval(counts)
        axes.plot([low, high], [row, row], color=theme.series[0], lw=5, alpha=0.35, solid_capstyle="round")
        axes.plot([counts.rate], [row], "o", color=theme.series[0], ms=7)
        axes.annotate(
            f"{100 * counts.rate:.0f} %  of {counts.n}",
            (1.03, row),
            xycoords=("axes fraction", "data"),
            va="center",
            color=theme.muted,
            fontsize=8.5,
        )
    axes.set_yticks(rows, [name.replace("_", " ") for name in rates])
    axes.set_ylim(max(len(rates), _FEWEST_ROWS) - 0.5, -0.5)
    axes.set_xlim(-0.02, 1.02)
    axes.xaxis.set_major_formatter(PercentFormatter(1.0, symbol=" %"))
    axes.grid(axis="x")


def draw_failures(axes: Axes, theme: Theme, suites: Mapping[str, Sequence[EpisodeRecord]]) -> None:
    """Failed episodes by reason, one colour a suite, the most frequent reason on top."""
    failures = [r for group in suites.values() for r in group if not r.success]
    if not failures:
        axes.axis("off")
        axes.text(0.5, 0.5, "no episode failed", ha="center", va="center", color=theme.muted)
        return
    reasons = sorted({r.outcome for r in failures}, key=lambda reason: -sum(r.outcome == reason for r in failures))
    left = np.zeros(len(reasons))
    for index, (name, group) in enumerate(suites.items()):
        counts = np.array([sum(r.outcome == reason and not r.success for r in group) for reason in reasons])
        axes.barh(reasons, counts, left=left, height=0.55, label=name, color=theme.series[index % len(theme.series)])
        left += counts
    axes.set_ylim(max(len(reasons), _FEWEST_ROWS) - 0.5, -0.5)
    axes.set_xlabel("episodes")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True, nbins=6))
    axes.grid(axis="x")
    if len(suites) > 1:
        _legend_above(axes)


def draw_lengths(axes: Axes, theme: Theme, records: Sequence[EpisodeRecord]) -> None:
    """How many steps successful and failed episodes took."""
    longest = max(record.steps for record in records)
    edges = np.linspace(0, longest, min(25, longest) + 1)
    successes = [r.steps for r in records if r.success]
    failures = [r.steps for r in records if not r.success]
    axes.hist([successes, failures], edges, stacked=True, color=[theme.good, theme.bad], label=["success", "failure"])
    axes.set_xlabel("policy steps")
    axes.set_ylabel("episodes")
    axes.yaxis.set_major_locator(MaxNLocator(integer=True, nbins=5))
    axes.grid(axis="y")
    _legend_above(axes)


def _legend_above(axes: Axes) -> None:
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=4, frameon=False, borderaxespad=0.2, handlelength=1.2)


def _style(theme: Theme) -> dict[str, object]:
    return {
        "font.size": 9.5,
        "font.family": "sans-serif",
        "text.color": theme.text,
        "axes.labelcolor": theme.muted,
        "axes.edgecolor": theme.grid,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.spines.left": False,
        "axes.axisbelow": True,
        "grid.color": theme.grid,
        "xtick.color": theme.muted,
        "ytick.color": theme.text,
        "xtick.major.size": 0,
        "ytick.major.size": 0,
    }
