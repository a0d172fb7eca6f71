"""What trials add up to: success with its interval, mean times, reasons of failures, and the thesis' numbers beside."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from tr_grasp.configs.dynamic import DYNAMIC_OBJECTS, MORE_MOTIONS, THESIS_MOTIONS
from tr_grasp.dynamic.record import TrialRecord
from tr_grasp.evaluation.dynamic.thesis import ALL, PREDICTORS, THESIS, best
from tr_grasp.evaluation.statistics import (
    Counts,
    PairedCounts,
    mcnemar_exact_test,
    paired_difference_interval,
    wilson_interval,
)

Records = Sequence[TrialRecord]
NOTHING = "-"
MOTION_WORDS = {"linear_obstacles": "obstacles", "linear_slab": "top shelf"}
"""As the thesis calls them."""
REASON_HEAD = ("method", "motion", "failure", "trials")
SPEED_HEAD = ("method", "motion", "speed [cm/s]", "trials", "success [%]", "95 % interval", "time [s]")
STUDY_HEAD = ("method", "trials", "success [%]", "95 % interval", "time [s]", "against the first", "p (McNemar)")
FEW = 3
"""So many methods are compared pair by pair, more of them with the first."""
COST_HEAD = ("method", "trials", "wall [s]", "simulated [s]", "thinking [s]", "loops a second", "attempts", "switches")


@dataclass(frozen=True)
class Result:
    """Trials of one cell of a table.

    Attributes:
        counts: How many succeeded.
        time_s: Mean time until the grasp was begun, of all trials; of a trial in which it never was, all of it.
        success_time_s, lifted_s: Mean time of the successes until the grasp was begun, and until the object was up.
    """

    counts: Counts
    time_s: float | None
    success_time_s: float | None
    lifted_s: float | None

    @classmethod
    def of(cls, records: Iterable[TrialRecord]) -> Result:
        """Of some trials, or none."""
        records = list(records)
        good = [record for record in records if record.success]
        return cls(
            Counts(len(good), len(records)),
            _mean([record.time_s for record in records]),
            _mean([record.time_s for record in good]),
            _mean([record.lifted_s for record in good if record.lifted_s is not None]),
        )

    @property
    def text(self) -> str:
        """``97.0 [91.5, 99.0] / 2.1``: success and its 95 % interval [%], mean time of all trials [s]."""
        if not self.counts.n:
            return NOTHING
        low, high = wilson_interval(self.counts)
        return f"{100 * self.counts.rate:.1f} [{100 * low:.1f}, {100 * high:.1f}] / {self.time_s:.1f}"


def table_head(motions: Sequence[str]) -> tuple[str, ...]:
    """Columns of :func:`object_rows`."""
    return ("object", *(MOTION_WORDS.get(motion, motion) for motion in motions))


def object_rows(records: Records, motions: Sequence[str]) -> list[tuple[str, ...]]:
    """One method at one speed in the shape of tables 5.8 to 5.10: a row for each object, then all of them.

    Below each of ours is the thesis' best of its three predictors, if it has that motion.
    """
    rows = []
    for name in (*DYNAMIC_OBJECTS, ALL):
        cells = [[r for r in records if r.motion == m and name in (r.object_name, ALL)] for m in motions]
        if not any(cells):
            continue
        rows.append((name, *(Result.of(cell).text for cell in cells)))
        thesis = [best(name, motion) for motion in motions]
        if any(thesis):
            rows.append(("  thesis, best", *(NOTHING if cell is None else _cell(*cell) for cell in thesis)))
    return rows


def method_rows(records: Records, motions: Sequence[str]) -> list[tuple[str, ...]]:
    """All objects in the shape of table 5.11: a row for each method and speed, then those of the thesis."""
    rows = [
        (f"{method}, {100 * speed:g} cm/s", *(Result.of(r for r in group if r.motion == m).text for m in motions))
        for (method, speed), group in grouped(records, lambda r: (r.method, r.speed_m_s)).items()
    ]
    for predictor in PREDICTORS:
        cells = [THESIS[predictor].get((ALL, motion)) for motion in motions]
        if any(cells):
            texts = (NOTHING if cell is None else _cell(*cell) for cell in cells)
            rows.append((f"thesis, {predictor}", *texts))
    return rows


def speed_rows(records: Records) -> list[tuple[str, ...]]:
    """Success against speed."""
    rows = []
    for (method, motion, speed), group in sorted(grouped(records, lambda r: (r.method, r.motion, r.speed_m_s)).items()):
        result = Result.of(group)
        low, high = wilson_interval(result.counts)
        rows.append(
            (
                method,
                motion,
                f"{100 * speed:g}",
                str(result.counts.n),
                f"{100 * result.counts.rate:.1f}",
                f"{100 * low:.1f} to {100 * high:.1f}",
                f"{result.time_s:.2f}",
            )
        )
    return rows


def reason_rows(records: Records) -> list[tuple[str, ...]]:
    """Why trials failed, the most frequent first."""
    failures = Counter((r.method, r.motion, r.outcome) for r in records if not r.success)
    return [(*key, str(n)) for key, n in sorted(failures.items(), key=lambda item: (*item[0][:2], -item[1]))]


def cost_rows(records: Records) -> list[tuple[str, ...]]:
    """What a trial of each method takes, on average."""
    rows = []
    for method, group in grouped(records, lambda r: r.method).items():
        n = len(group)
        means = [sum(getattr(r, name) for r in group) / n for name in ("wall_s", "end_s", "thinking_s")]
        planned = [r for r in group if r.loops]  # a method that the judge has cut off cannot tell
        rate = sum(r.loops for r in planned) / sum(r.time_s for r in planned) if planned else 0.0
        others = [sum(getattr(r, name) for r in group) / n for name in ("attempts", "switches")]
        texts = (f"{value:.2f}" for value in (*means, rate, *others))
        rows.append((method, str(n), *texts))
    return rows


def study_rows(records: Records) -> list[tuple[str, ...]]:
    """Each method on all its trials, and how much better it is than the first on the trials that both ran."""
    groups = grouped(records, lambda r: r.method)
    base, rows = next(iter(groups), None), []
    for name, group in groups.items():
        result, pairs = Result.of(group), paired_counts(group, groups[base])
        low, high = wilson_interval(result.counts)
        success = f"{100 * result.counts.rate:.1f}", f"{100 * low:.1f} to {100 * high:.1f}"
        against = (NOTHING, NOTHING)
        if name != base and pairs.n:
            gain = 100 * (pairs.only_a - pairs.only_b) / pairs.n
            against = (f"{gain:+.1f}", f"{mcnemar_exact_test(pairs):.2g}")
        rows.append((name, str(result.counts.n), *success, f"{result.time_s:.2f}", *against))
    return rows


def pair_sentences(records: Records) -> list[str]:
    """For each two methods, on the trials that both ran: who is better, by how much, and how sure that is."""
    groups = grouped(records, lambda r: r.method)
    names = sorted(groups)
    pairs = {(a, b): paired_counts(groups[a], groups[b]) for i, a in enumerate(names) for b in names[i + 1 :]}
    return [_pair_sentence(a, b, counts) for (a, b), counts in pairs.items() if counts.n]


def paired_counts(a: Records, b: Records) -> PairedCounts:
    """What two methods made of the trials that both ran."""
    of_a, of_b = ({r.key[1:]: r.success for r in group} for group in (a, b))
    tally = Counter((of_a[key], of_b[key]) for key in of_a.keys() & of_b.keys())
    return PairedCounts(tally[True, True], tally[True, False], tally[False, True], tally[False, False])


def grouped(records: Iterable[TrialRecord], key: Callable[[TrialRecord], object]) -> dict:
    """Records by a key, in the order in which the keys appear."""
    groups: dict = {}
    for record in records:
        groups.setdefault(key(record), []).append(record)
    return groups


def motions_of(records: Iterable[TrialRecord]) -> list[str]:
    """The motions that occur, those of the thesis first."""
    there = {record.motion for record in records}
    return [motion for motion in (*THESIS_MOTIONS, *MORE_MOTIONS) if motion in there]


def _pair_sentence(a: str, b: str, pairs: PairedCounts) -> str:
    low, high = paired_difference_interval(pairs)
    gain = 100 * (pairs.only_a - pairs.only_b) / pairs.n
    return (
        f"{a} against {b} on {pairs.n} shared trials: {gain:+.1f} points, 95 % interval {100 * low:+.1f} to"
        f" {100 * high:+.1f}, p = {mcnemar_exact_test(pairs):.2g} (McNemar)."
    )


def _cell(success: float, time_s: float) -> str:
    return f"{success:g} / {time_s:.1f}"


def _mean(values: Sequence[float]) -> float | None:
    return sum(values) / len(values) if values else None
