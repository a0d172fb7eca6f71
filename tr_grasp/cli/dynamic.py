"""``tr-grasp dynamic``: grasp objects that move on unknown paths; judge the ways to do it, or watch one trial."""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypeVar

from tqdm import tqdm

from tr_grasp.cli.table import text_table
from tr_grasp.configs.dynamic import (
    DYNAMIC_OBJECTS,
    MORE_MOTIONS,
    THESIS_MOTIONS,
    ChargesCfg,
    DynamicCfg,
    DynamicMotion,
    DynamicObject,
    TrackingCfg,
)
from tr_grasp.configs.io import parse
from tr_grasp.dynamic.settings import GrasperCfg
from tr_grasp.errors import ConfigError, unknown_name
from tr_grasp.evaluation.dynamic.variations import StudyName, variations
from tr_grasp.files import make_folder, write_atomically
from tr_grasp.provenance import cores_n, provenance

if TYPE_CHECKING:
    from tr_grasp.dynamic.record import TrialRecord
    from tr_grasp.evaluation.dynamic.run import Contender, Job, Plan

USAGE = """Grasp what moves on its own.

  tr-grasp dynamic evaluate [--SETTING VALUE ...]     judge methods on seeded trials: tables, report, films
  tr-grasp dynamic play [--SETTING VALUE ...]         run one trial and film it

`tr-grasp dynamic evaluate --help` and `tr-grasp dynamic play --help` list the settings.
"""
Method = Literal["intercept", "thesis", "both"]
Conditions = Literal["ours", "thesis"]
REPORT_FILE, SUMMARY_FILE, REPLAYS_FOLDER = "report.html", "summary.json", "replays"


@dataclass(frozen=True)
class EvaluateCfg:
    """Judge ways to grasp moving objects. The same command goes on with what an interruption left."""

    method: Method = "intercept"
    """Ours, the thesis' Algorithm 1 with its constants, or one after the other on the same trials."""

    conditions: Conditions = "ours"
    """World from which other settings differ. ``thesis``: fixed charges for planning, poses at 5 Hz, a target of 1 kg,
    a carrier that stops when the object is lifted; ``ours``: measured charges, 30 Hz, real masses, no stop."""

    motions: tuple[str, ...] = ("thesis",)
    """Names; ``thesis`` for the five of its tables, ``all`` for ten."""

    objects: tuple[str, ...] = ("all",)
    """Names, or ``all`` five."""

    trials: int = 100
    """Of each motion, object and speed."""

    speed: tuple[float, ...] = (0.03,)
    """Of the carrier [m/s]; several make a curve."""

    seed: int = 0
    """Of the lists of trials."""

    study: StudyName = "none"
    """Judge variations of the method beside it: ``ablations`` changes its predictor, its ranking and each of its
    switches in turn, ``noise`` (0 to 5 mm) and ``latency`` (0 to 200 ms) how well the target is tracked."""

    label: str | None = None
    """Name of the method in the tables; several runs may share a folder."""

    out: Path | None = None
    """Folder of the results; by default a new one under runs/dynamic."""

    workers: int = field(default_factory=lambda: min(2, cores_n()))
    """Processes. Measured charges grow when they share a core."""

    replays: int = 4
    """Trials that are filmed for the report, failures and successes in turn."""

    world: DynamicCfg = field(default_factory=DynamicCfg)
    """Where."""

    grasper: GrasperCfg = field(default_factory=GrasperCfg)
    """How."""

    def __post_init__(self) -> None:
        for name in ("trials", "workers"):
            if getattr(self, name) < 1:
                raise ConfigError(f"--{name} must be at least 1, got {getattr(self, name)}.")
        if self.replays < 0 or self.seed < 0:
            raise ConfigError(f"--replays and --seed must not be negative, got {self.replays} and {self.seed}.")
        if not self.speed or min(self.speed) <= 0:
            raise ConfigError(f"--speed must be positive, got {self.speed}.")
        if self.study != "none" and self.method == "both":
            raise ConfigError(f"--study {self.study} is of one method; choose --method intercept or thesis.")
        if self.label is not None and (self.method == "both" or not self.label.replace("-", "").isalnum()):
            raise ConfigError(f"--label must be letters, digits and hyphens, for one method; got {self.label!r}.")


@dataclass(frozen=True)
class PlayCfg:
    """Run one trial and film it."""

    method: Literal["intercept", "thesis"] = "intercept"
    """Ours, or the thesis' Algorithm 1."""

    conditions: Conditions = "ours"
    """As for ``evaluate``."""

    motion: DynamicMotion = "linear"
    """What the carrier does."""

    object: DynamicObject = "006_mustard_bottle"
    """What it carries."""

    number: int = 0
    """Of the trial in its list."""

    seed: int = 0
    """Of the list."""

    speed: float = 0.03
    """Of the carrier [m/s]."""

    view: Path = Path("dynamic.gif")
    """The film: GIF, MP4, or a PNG of six instants."""

    size: int = 420
    """Of the picture [px]."""

    world: DynamicCfg = field(default_factory=DynamicCfg)
    """Where."""

    grasper: GrasperCfg = field(default_factory=GrasperCfg)
    """How."""


Cfg = TypeVar("Cfg", EvaluateCfg, PlayCfg)


def main(args: list[str]) -> int:
    """Run the verb."""
    what, *rest = args or ["--help"]
    if what in ("-h", "--help"):
        print(USAGE)
        return 0
    if what == "evaluate":
        return evaluate(rest, shlex.join(["tr-grasp", "dynamic", *args]))
    if what == "play":
        return play(rest)
    raise ConfigError(f"{unknown_name('subcommand', what, ('evaluate', 'play'))} Try `tr-grasp dynamic --help`.")


def read(cfg_class: type[Cfg], args: Sequence[str], method: str | None = None) -> Cfg:
    """Settings over those that ``--method`` and ``--conditions`` stand for.

    Args:
        cfg_class: Of the subcommand.
        args: After it.
        method: Instead of the one in the arguments.
    """
    prog = f"tr-grasp dynamic {'evaluate' if cfg_class is EvaluateCfg else 'play'}"
    first = parse(cfg_class, args, prog=prog)
    grasper = GrasperCfg.thesis() if (method or first.method) == "thesis" else GrasperCfg()
    world = thesis_world() if first.conditions == "thesis" else DynamicCfg()
    return parse(cfg_class, args, cfg_class(world=world, grasper=grasper), prog=prog)


def thesis_world() -> DynamicCfg:
    """The conditions of the thesis' simulation."""
    return DynamicCfg(
        target_mass_kg=1.0,
        freeze_on_lift=True,
        charges=ChargesCfg(mode="fixed"),
        tracking=TrackingCfg(rate_hz=5.0),
    )


def evaluate(args: Sequence[str], command: str) -> int:
    """Evaluate, with progress, tables and paths on the terminal."""
    cfg = read(EvaluateCfg, args)
    motions = chosen("motion", cfg.motions, {"thesis": THESIS_MOTIONS, "all": (*THESIS_MOTIONS, *MORE_MOTIONS)})
    objects = chosen("object", cfg.objects, {"all": DYNAMIC_OBJECTS})
    out = cfg.out or Path("runs/dynamic") / f"{cfg.method}-{datetime.now().strftime('%Y%m%d-%H%M%S')}"
    # --help must not wait for a simulator.
    from tr_grasp.evaluation.dynamic.run import Plan
    from tr_grasp.evaluation.dynamic.run import evaluate as run_plan

    plan = Plan(_contenders(cfg, args), motions, objects, cfg.speed, cfg.trials, cfg.seed)
    interrupted = False
    try:
        with _Bar(len(list(plan.jobs()))) as bar:
            run_plan(plan, out, workers=cfg.workers, on_trial=bar.update)
    except KeyboardInterrupt:
        interrupted = True
    return 130 if not _report(plan, out, command, 0 if interrupted else cfg.replays) or interrupted else 0


def play(args: Sequence[str]) -> int:
    """Run one trial, film it, and say how it ended."""
    cfg = read(PlayCfg, args)
    from tr_grasp.envs.dynamic_grasp import make_trial
    from tr_grasp.evaluation.dynamic.replay import FRAME_S, film_trial
    from tr_grasp.evaluation.dynamic.run import Contender, Job
    from tr_grasp.evaluation.film import check_format, save_film

    check_format(cfg.view)
    trial = make_trial(cfg.motion, cfg.object, cfg.number, cfg.seed)
    world = replace(cfg.world, speed_m_s=cfg.speed)
    job = Job(Contender(cfg.method, cfg.grasper, world), world, trial)
    record, frames = film_trial(job, cfg.size)
    make_folder(cfg.view.parent)
    save_film(cfg.view, frames, FRAME_S)
    print(f"{record.outcome}{f' ({record.detail})' if record.detail else ''}, after {record.end_s:.1f} s")
    if record.committed:
        print(f"the grasp was begun at {record.time_s:.1f} s; attempts {record.attempts}, switches {record.switches}")
    print(f"film  {cfg.view}")
    return 0


def chosen(what: str, names: Sequence[str], groups: dict[str, tuple[str, ...]]) -> tuple[str, ...]:
    """Names with groups spelt out, each once.

    Raises:
        ConfigError: No such name, or none at all.
    """
    known = {name for group in groups.values() for name in group}
    for name in names:
        if name not in known and name not in groups:
            raise ConfigError(unknown_name(what, name, (*groups, *known)))
    if not names:
        raise ConfigError(f"name at least one {what}.")
    return tuple(dict.fromkeys(found for name in names for found in groups.get(name, (name,))))


def _contenders(cfg: EvaluateCfg, args: Sequence[str]) -> tuple[Contender, ...]:
    from tr_grasp.evaluation.dynamic.run import Contender

    names = ("intercept", "thesis") if cfg.method == "both" else (cfg.method,)
    bases = (Contender(cfg.label or name, read(EvaluateCfg, args, name).grasper, cfg.world) for name in names)
    return tuple(one for base in bases for one in variations(base, cfg.study))


def _report(plan: Plan, out: Path, command: str, replays_n: int) -> bool:
    """Tables, report and films of what the folder holds; nothing is said if that is no trial."""
    from tr_grasp.evaluation.dynamic import summary
    from tr_grasp.evaluation.dynamic.log import TRIALS_FILE, read_trials
    from tr_grasp.evaluation.dynamic.report import Report

    records = read_trials(out) if (out / TRIALS_FILE).is_file() else []
    if not records:
        return False
    motions = summary.motions_of(records)
    for (method, speed), group in summary.grouped(records, lambda r: (r.method, r.speed_m_s)).items():
        print(f"\n{method}, {100 * speed:g} cm/s: success [95 % interval] / mean time [s] (tables 5.8 to 5.10)\n")
        print(text_table(summary.table_head(motions), summary.object_rows(group, motions)))
    print("\nall objects (table 5.11)\n")
    print(text_table(("method", *summary.table_head(motions)[1:]), summary.method_rows(records, motions)))
    if len({record.speed_m_s for record in records}) > 1:
        print(f"\nsuccess against speed\n\n{text_table(summary.SPEED_HEAD, summary.speed_rows(records), left_n=2)}")
    if reasons := summary.reason_rows(records):
        print(f"\n{text_table(summary.REASON_HEAD, reasons, left_n=3)}")
    print(f"\n{text_table(summary.COST_HEAD, summary.cost_rows(records))}\n")
    if len({record.method for record in records}) <= summary.FEW:
        print("\n".join(summary.pair_sentences(records)))
    else:
        print(text_table(summary.STUDY_HEAD, summary.study_rows(records)))
    settings = {one.name: (one.world, one.cfg) for one in plan.contenders}
    replays = _films(plan, records, out, replays_n)
    write_atomically(out / REPORT_FILE, Report(records, settings, provenance(command), replays).html())
    rows = [dict(zip(summary.SPEED_HEAD, row, strict=True)) for row in summary.speed_rows(records)]
    write_atomically(out / SUMMARY_FILE, json.dumps({"command": command, "cells": rows}, indent=2) + "\n")
    print(f"\ntrials    {out / TRIALS_FILE}\nreport    {out / REPORT_FILE}")
    return True


def _films(plan: Plan, records: Sequence[TrialRecord], out: Path, count: int) -> list:
    from tr_grasp.evaluation.dynamic.replay import FRAME_S, choose, film_trial
    from tr_grasp.evaluation.dynamic.report import Replay
    from tr_grasp.evaluation.film import encode_gif

    jobs: dict[tuple, Job] = {job.key: job for job in plan.jobs()}
    films = []
    for record in choose([record for record in records if record.key in jobs], count):
        again, frames = film_trial(jobs[record.key])
        gif = encode_gif(frames, FRAME_S)
        make_folder(out / REPLAYS_FOLDER)
        name = f"{record.method}_{record.motion}_{record.object_name}_{record.number}.gif"
        write_atomically(out / REPLAYS_FOLDER / name, gif)
        films.append(Replay(record, again, gif))
    return films


class _Bar:
    """Trials done, time left and success so far, on stderr."""

    def __init__(self, trials_n: int) -> None:
        # A log file is not a terminal: there, every refresh is a line of its own.
        pause_s = 0.2 if sys.stderr.isatty() else 10.0
        self._bar = tqdm(total=trials_n, unit="trial", mininterval=pause_s, dynamic_ncols=True)
        self._successes = self._done = 0

    def __enter__(self) -> _Bar:
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.close()

    def update(self, record: TrialRecord) -> None:
        """Count one."""
        self._done += 1
        self._successes += record.success
        self._bar.set_postfix_str(f"success {100 * self._successes / self._done:.0f} %", refresh=False)
        self._bar.update()
