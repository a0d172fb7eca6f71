"""The report of an evaluation: one HTML file that needs nothing beside it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import reduce
from html import escape
from pathlib import Path
from typing import Any

from tr_grasp.configs import EnvCfg, TrainCfg
from tr_grasp.configs.build import leaf_types
from tr_grasp.evaluation import page
from tr_grasp.evaluation.plots import DARK, LIGHT, Plot, plots_of
from tr_grasp.evaluation.records import EpisodeRecord, by_suite, in_order
from tr_grasp.evaluation.statistics import MeanStd, wilson_interval
from tr_grasp.evaluation.suites import ARRANGEMENTS, Suite
from tr_grasp.evaluation.summary import SuiteSummary, by_family, by_number, count, summarise
from tr_grasp.provenance import Provenance

SUMMARY_COLUMNS = (
    "suite",
    "episodes",
    "success",
    "95 % interval",
    "reward",
    "length [steps]",
    "length of successes [steps]",
)


@dataclass(frozen=True, eq=False)
class Shown:
    """A replay that the report shows."""

    evaluated: EpisodeRecord
    """The episode as it was judged."""
    replayed: EpisodeRecord
    """The same episode, played again for the film."""
    gif: bytes
    """The film."""


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Everything that a report tells."""

    player: str
    """Name of what was judged."""
    suites: Sequence[Suite]
    """What was asked."""
    records: Sequence[EpisodeRecord]
    """What was finished."""
    provenance: Provenance
    """Where it comes from."""
    training: TrainCfg | None = None
    """What it was trained with."""

    @property
    def asked_n(self) -> int:
        """Episodes that were asked for."""
        return sum(suite.episodes for suite in self.suites)

    @property
    def summaries(self) -> list[SuiteSummary]:
        """One for each suite with a finished episode."""
        return [summarise(name, group) for name, group in by_suite(in_order(self.records)).items()]

    @property
    def failure_reasons(self) -> set[str]:
        """Every way in which an episode failed."""
        return {record.outcome for record in self.records if not record.success}

    def as_json(self) -> dict[str, Any]:
        """Plain dictionaries and numbers: what ``summary.json`` holds."""
        return {
            "policy": self.player,
            "objects": describe_objects(self.suites[0].env),
            "first_seed": self.suites[0].first_seed,
            "episodes_asked": self.asked_n,
            "episodes_finished": len(self.records),
            "suites": [summary.as_json() for summary in self.summaries],
            "by_family": {name: list(counts) for name, counts in by_family(self.records).items()},
            "by_number": {name: list(counts) for name, counts in by_number(self.records).items()},
            **self.provenance.as_json(),
        }


def report_html(evaluation: Evaluation, replays: Sequence[Shown] = ()) -> str:
    """The report as one HTML page.

    Args:
        evaluation: With at least one finished episode.
        replays: Films to show.
    """
    title = f"{evaluation.player} on {describe_objects(evaluation.suites[0].env)}"
    sections = [_header(title, evaluation), page.section("Results", page.card(summary_table(evaluation.summaries)))]
    sections.append(page.section("In pictures", *_plots(evaluation.records)))
    if replays:
        note = '<p class="lead">Left the scene, right the octree that the policy was given and its gripper.</p>'
        sections.append(page.section("Replays", note, page.grid(_replay(shown) for shown in replays)))
    sections.append(page.section("How to get the same", page.card(page.facts(_facts(evaluation)))))
    sections.append(page.section("Settings that differ from the defaults", page.card(_settings(evaluation))))
    return page.page(title, sections)


def summary_row(summary: SuiteSummary) -> tuple[str, ...]:
    """The cells of ``SUMMARY_COLUMNS``."""
    low, high = summary.interval
    return (
        summary.suite,
        str(summary.success.n),
        f"{100 * summary.success.rate:.1f} %",
        f"{100 * low:.1f} to {100 * high:.1f} %",
        _spread(summary.reward),
        _spread(summary.steps),
        _spread(summary.steps_of_successes),
    )


def summary_table(summaries: Iterable[SuiteSummary]) -> str:
    """The summary table in HTML."""
    rows = []
    for summary in summaries:
        name, episodes, success, *others = summary_row(summary)
        rows.append((name, episodes, f"<strong>{success}</strong>", *others))
    return page.table(SUMMARY_COLUMNS, rows)


def differing_settings(cfg: Any, default: Any) -> list[tuple[str, str]]:
    """Dotted path and ``value (default: other)`` of each setting in which two configurations of one kind differ."""
    found = []
    for path, _ in leaf_types(type(cfg)):
        value, other = (reduce(getattr, path.split("."), root) for root in (cfg, default))
        if value != other:
            found.append((path, f"{value}   (default: {other})"))
    return found


def describe_objects(env: EnvCfg) -> str:
    """The objects of a world in words."""
    objects = env.objects
    if objects.source == "procedural":
        return "held-out procedural objects" if objects.split == "test" else "procedural training objects"
    if objects.source == "procedural_wide":
        return f"procedural objects, wide ones among them ({objects.split} split)"
    return f"objects of {'/'.join(Path(objects.source).parts[-2:])}"


def _header(title: str, evaluation: Evaluation) -> str:
    total = count(evaluation.records)
    low, high = wilson_interval(total)
    sentence = (
        f"{total.successes} of {total.n} episodes lifted an object: {100 * total.rate:.1f} % "
        f"(95 % interval {100 * low:.1f} to {100 * high:.1f} %)."
    )
    if total.n < evaluation.asked_n:
        sentence += f" Stopped early: {evaluation.asked_n} episodes were asked for."
    return f'<header><h1>{escape(title)}</h1><p class="lead">{escape(sentence)}</p></header>'


def _plots(records: Sequence[EpisodeRecord]) -> list[str]:
    """Narrow plots beside each other, wide ones below."""
    plots = plots_of(in_order(records), by_family(records), by_number(records))
    return [page.grid(map(_plot, (p for p in plots if not p.is_wide))), *map(_plot, (p for p in plots if p.is_wide))]


def _plot(plot: Plot) -> str:
    return page.card(page.themed_picture(plot.png(LIGHT), plot.png(DARK), plot.title))


def _replay(shown: Shown) -> str:
    record, again = shown.evaluated, shown.replayed
    word = "good" if again.success else "bad"
    caption = (
        f'<strong class="{word}">{escape(again.outcome)}</strong> after {again.steps} steps · {escape(record.suite)}, '
        f"seed {record.seed} · {escape(', '.join(record.families))}"
    )
    if again != record:
        caption += f" · the judged episode ended otherwise: {escape(record.outcome)} after {record.steps} steps"
    return page.card(page.film(shown.gif, caption, alt=f"{record.suite}, seed {record.seed}: {again.outcome}"))


def _facts(evaluation: Evaluation) -> list[tuple[str, str]]:
    source, first = evaluation.provenance, evaluation.suites[0]
    worlds = "; ".join(f"{s.name}: {ARRANGEMENTS[s.name].words}" for s in evaluation.suites if s.name in ARRANGEMENTS)
    return [
        ("command", source.command),
        ("commit", source.commit or "none: not run from a committed source tree"),
        ("seeds", f"{first.first_seed} to {first.first_seed + first.episodes - 1}, a fresh scene each, in every suite"),
        ("suites", worlds),
        ("policy", "deterministic (the mean of its distribution)"),
        ("machine", source.machine),
        ("versions", ", ".join(f"{name} {version}" for name, version in source.versions.items())),
        ("started", source.started),
    ]


def _settings(evaluation: Evaluation) -> str:
    rows = _world_settings(evaluation.suites)
    if evaluation.training is not None:
        learned = differing_settings(evaluation.training, TrainCfg())
        rows += [(path, text) for path, text in learned if not path.startswith("env.")]
    return page.facts(rows or [("none", "every setting has its default value")])


def _world_settings(suites: Sequence[Suite]) -> list[tuple[str, str]]:
    """What differs from the default worlds: once where all suites agree, else with the suite's name."""
    differing = {suite.name: dict(differing_settings(suite.env, EnvCfg())) for suite in suites}
    rows = []
    for path in dict.fromkeys(path for of_suite in differing.values() for path in of_suite):
        values = {name: of_suite[path] for name, of_suite in differing.items() if path in of_suite}
        if len(values) == len(suites) and len(set(values.values())) == 1:
            rows.append((f"env.{path}", next(iter(values.values()))))
        else:
            rows += [(f"env.{path} ({name})", value) for name, value in values.items()]
    return rows


def _spread(value: MeanStd | None) -> str:
    return "-" if value is None else f"{value.mean:.1f} ± {value.std:.1f}"
