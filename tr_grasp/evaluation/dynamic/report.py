"""The report of an evaluation of Task II: one HTML file that needs nothing beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import PercentFormatter

from tr_grasp.configs.dynamic import DynamicCfg
from tr_grasp.dynamic.record import TrialRecord
from tr_grasp.dynamic.settings import GrasperCfg
from tr_grasp.evaluation import page
from tr_grasp.evaluation.dynamic import summary
from tr_grasp.evaluation.dynamic.thesis import ALL, best
from tr_grasp.evaluation.plots import DARK, LIGHT, Plot, Theme, draw_rates
from tr_grasp.evaluation.report import differing_settings
from tr_grasp.evaluation.statistics import Counts, wilson_interval
from tr_grasp.provenance import Provenance

Records = Sequence[TrialRecord]

LEAD = (
    "Each cell: success with its 95 % interval [%] / mean time until the grasp was begun [s], over all trials, as the"
    " thesis counts; a trial in which it never was counts with all of its time."
)


@dataclass(frozen=True, eq=False)
class Replay:
    """A film of a trial.

    Attributes:
        judged: The row in the table.
        again: What it gave while it was filmed.
        gif: The film.
    """

    judged: TrialRecord
    again: TrialRecord
    gif: bytes


@dataclass(frozen=True, eq=False)
class Report:
    """What it tells.

    Attributes:
        records: At least one.
        settings: World and method, by the method's name in the table.
        provenance: Of this run.
        replays: Films.
    """

    records: Records
    settings: dict[str, tuple[DynamicCfg, GrasperCfg]]
    provenance: Provenance
    replays: Sequence[Replay] = ()

    def html(self) -> str:
        """The page."""
        motions = summary.motions_of(self.records)
        sections = [_header(self.records)]
        rows = summary.method_rows(self.records, motions)
        if len({record.method for record in self.records}) <= summary.FEW:
            compared = "".join(f"<p>{escape(text)}</p>" for text in summary.pair_sentences(self.records))
        else:
            compared = page.table(summary.STUDY_HEAD, summary.study_rows(self.records))
        table = page.table(("method", *summary.table_head(motions)[1:]), rows)
        sections.append(page.section("All objects (table 5.11)", _lead(LEAD), page.card(table, compared)))
        for (method, speed), group in summary.grouped(self.records, lambda r: (r.method, r.speed_m_s)).items():
            table = page.table(summary.table_head(motions), summary.object_rows(group, motions))
            title = f"{method}, {100 * speed:g} cm/s, by object (tables 5.8 to 5.10)"
            sections.append(page.section(title, page.card(table)))
        sections.append(page.section("In pictures", page.grid(map(_plot, self._plots()))))
        reasons = page.table(summary.REASON_HEAD, summary.reason_rows(self.records))
        sections.append(page.section("Why trials failed", page.card(reasons)))
        sections.append(page.section("Cost", page.card(page.table(summary.COST_HEAD, summary.cost_rows(self.records)))))
        if self.replays:
            sections.append(page.section("Replays", page.grid(map(_replay, self.replays))))
        sections.append(page.section("How to get the same", page.card(page.facts(self._facts()))))
        return page.page("Grasping what moves", sections)

    def _plots(self) -> list[Plot]:
        records, methods = self.records, summary.grouped(self.records, lambda r: r.method)
        if len(methods) > summary.FEW:  # more than a plot has colours for
            rates = {method: _counts(group) for method, group in methods.items()}
            return [
                Plot("Success, with 95 % interval", lambda axes, theme: draw_rates(axes, theme, rates), len(rates)),
                Plot(
                    "Mean time until the grasp was begun",
                    lambda axes, theme: draw_mean_times(axes, theme, records),
                    len(rates),
                ),
            ]
        plots = [
            Plot("Success by motion; ◇ the thesis' best", lambda axes, theme: draw_motions(axes, theme, records), 8)
        ]
        if len({record.speed_m_s for record in records}) > 1:
            plots.append(Plot("Success against speed", lambda axes, theme: draw_speeds(axes, theme, records), 8))
        plots.append(Plot("When the grasp was begun", lambda axes, theme: draw_times(axes, theme, records), 8))
        return plots

    def _facts(self) -> list[tuple[str, str]]:
        source = self.provenance
        rows = [
            ("command", source.command),
            ("commit", source.commit or "none: not run from a committed source tree"),
            ("machine", source.machine),
            ("versions", ", ".join(f"{name} {version}" for name, version in source.versions.items())),
            ("trials", "paired: a number and seed give the same path, heading and obstacles to every method and speed"),
        ]
        for name, (world, grasper) in self.settings.items():
            differing = differing_settings(world, DynamicCfg()) + differing_settings(grasper, GrasperCfg())
            rows += [(f"{name}: {path}", text) for path, text in differing]
        return rows


def draw_motions(axes: Axes, theme: Theme, records: Records) -> None:
    """Success of each method in each motion, with intervals, the thesis' best beside."""
    motions, methods = summary.motions_of(records), list(summary.grouped(records, lambda r: r.method))
    for row, motion in enumerate(motions):
        for k, method in enumerate(methods):
            counts = _counts([r for r in records if r.motion == motion and r.method == method])
            if counts.n:
                _draw_rate(axes, theme, counts, row + 0.22 * (k - (len(methods) - 1) / 2), k, method if not row else "")
        thesis = best(ALL, motion)
        if thesis is not None:
            axes.plot([thesis.success / 100], [row], "D", color=theme.muted, mfc="none", ms=7)
    axes.set_yticks(range(len(motions)), [summary.MOTION_WORDS.get(m, m).replace("_", " ") for m in motions])
    axes.set_ylim(max(len(motions), 3) - 0.5, -0.5)
    axes.set_xlim(-0.02, 1.02)
    axes.xaxis.set_major_formatter(PercentFormatter(1.0, symbol=" %"))
    axes.grid(axis="x")
    _legend(axes)


def draw_mean_times(axes: Axes, theme: Theme, records: Records) -> None:
    """Mean time of each method until the grasp was begun, over all trials, the first on top."""
    methods = summary.grouped(records, lambda r: r.method)
    rows = np.arange(len(methods))
    times = [summary.Result.of(group).time_s or 0.0 for group in methods.values()]
    axes.barh(rows, times, height=0.55, color=theme.series[0])
    axes.set_yticks(rows, list(methods))
    axes.set_ylim(len(methods) - 0.5, -0.5)
    axes.set_xlabel("time [s]")
    axes.grid(axis="x")


def draw_speeds(axes: Axes, theme: Theme, records: Records) -> None:
    """Success of each method over the carrier's speed, all motions together, with intervals."""
    for k, (method, group) in enumerate(summary.grouped(records, lambda r: r.method).items()):
        speeds = sorted({r.speed_m_s for r in group})
        counts = [_counts([r for r in group if r.speed_m_s == speed]) for speed in speeds]
        low, high = zip(*(wilson_interval(one) for one in counts), strict=True)
        colour, x = theme.series[k % len(theme.series)], 100 * np.array(speeds)
        axes.fill_between(x, low, high, color=colour, alpha=0.2, lw=0)
        axes.plot(x, [one.rate for one in counts], "o-", color=colour, label=method)
    axes.set_xlabel("speed [cm/s]")
    axes.set_ylim(-0.02, 1.02)
    axes.yaxis.set_major_formatter(PercentFormatter(1.0, symbol=" %"))
    axes.grid()
    _legend(axes)


def draw_times(axes: Axes, theme: Theme, records: Records) -> None:
    """Share of all trials in which the grasp that succeeded was begun by then."""
    for k, (method, group) in enumerate(summary.grouped(records, lambda r: r.method).items()):
        times = sorted(r.time_s for r in group if r.success)
        shares = np.arange(1, len(times) + 1) / len(group)
        axes.step([0.0, *times], [0.0, *shares], where="post", color=theme.series[k % len(theme.series)], label=method)
    axes.set_xlabel("time [s]")
    axes.set_ylim(-0.02, 1.02)
    axes.yaxis.set_major_formatter(PercentFormatter(1.0, symbol=" %"))
    axes.grid()
    _legend(axes)


def _draw_rate(axes: Axes, theme: Theme, counts: Counts, row: float, series: int, label: str) -> None:
    low, high = wilson_interval(counts)
    colour = theme.series[series % len(theme.series)]
    axes.plot([low, high], [row, row], color=colour, lw=4, alpha=0.35, solid_capstyle="round")
    axes.plot([counts.rate], [row], "o", color=colour, ms=6, label=label or None)


def _legend(axes: Axes) -> None:
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=4, frameon=False, borderaxespad=0.2, handlelength=1.2)


def _counts(records: Records) -> Counts:
    return Counts(sum(r.success for r in records), len(records))


def _header(records: Records) -> str:
    total = _counts(records)
    low, high = wilson_interval(total)
    sentence = (
        f"{total.successes} of {total.n} trials lifted and held the object: {100 * total.rate:.1f} % "
        f"(95 % interval {100 * low:.1f} to {100 * high:.1f} %)."
    )
    return f"<header><h1>Grasping what moves</h1>{_lead(sentence)}</header>"


def _lead(text: str) -> str:
    return f'<p class="lead">{escape(text)}</p>'


def _plot(plot: Plot) -> str:
    return page.card(page.themed_picture(plot.png(LIGHT), plot.png(DARK), plot.title))


def _replay(replay: Replay) -> str:
    judged, again = replay.judged, replay.again
    word = "good" if again.success else "bad"
    caption = (
        f'<strong class="{word}">{escape(again.outcome)}</strong> · {escape(again.method)} · {escape(again.motion)},'
        f" {escape(again.object_name)}, {100 * again.speed_m_s:g} cm/s, trial {again.number}"
    )
    if again.outcome != judged.outcome:
        caption += f" · the judged trial ended otherwise: {escape(judged.outcome)}"
    return page.card(page.film(replay.gif, caption, alt=f"{again.motion}, trial {again.number}: {again.outcome}"))
