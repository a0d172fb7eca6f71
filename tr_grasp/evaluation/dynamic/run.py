"""A whole evaluation of Task II: trials in several processes, each kept as it ends; it can be gone on with."""

from __future__ import annotations

import json
import multiprocessing
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict, dataclass, field, replace
from functools import cache, lru_cache
from pathlib import Path

from tr_grasp.configs.dynamic import DynamicCfg
from tr_grasp.dynamic.grasper import DynamicGrasper
from tr_grasp.dynamic.record import TrialKey, TrialRecord
from tr_grasp.dynamic.settings import GrasperCfg
from tr_grasp.envs.dynamic_grasp import Trial, make_trial, run_trial
from tr_grasp.errors import ConfigError, TrGraspError
from tr_grasp.evaluation.dynamic.log import TrialLog
from tr_grasp.evaluation.rollouts import one_thread
from tr_grasp.files import make_folder, write_atomically
from tr_grasp.grasps.motion_aware import motion_aware_scorer, shipped_scorers
from tr_grasp.grasps.ranking import RankingAids
from tr_grasp.grasps.reachability import reachability_field, shipped_fields

LISTS_FILE = "lists.json"
NETWORKS = ("mlp", "lstm")
"""Predictors of the thesis that were trained for one class of motion each."""


class WorkerDiedError(TrGraspError, RuntimeError):
    """A process that ran trials ended by itself."""


# A plan is gone through several times, and drawing a path that fits takes some milliseconds.
_trial = lru_cache(maxsize=None)(make_trial)


@dataclass(frozen=True)
class Contender:
    """A method under its name in the tables, and the world in which it is judged; the world's own speed does not count.

    Several methods are compared in one world, or one method in several.
    """

    name: str
    cfg: GrasperCfg
    world: DynamicCfg


@dataclass(frozen=True)
class Plan:
    """What is to be run: every method at every speed on every trial of every motion and object.

    Attributes:
        contenders: The methods.
        motions, objects, speeds_m_s: The cases.
        trials_n: Trials of each.
        seed: Of the lists.
    """

    contenders: tuple[Contender, ...]
    motions: tuple[str, ...]
    objects: tuple[str, ...]
    speeds_m_s: tuple[float, ...]
    trials_n: int
    seed: int = 0

    def jobs(self) -> Iterator[Job]:
        """Trial by trial through all cases, so that what an interruption leaves is balanced."""
        for number in range(self.trials_n):
            for motion in self.motions:
                for object_name in self.objects:
                    trial = _trial(motion, object_name, number, self.seed)
                    for speed in self.speeds_m_s:
                        for contender in self.contenders:
                            yield Job(contender, replace(contender.world, speed_m_s=speed), trial)


@dataclass(frozen=True)
class Job:
    """One trial of one method."""

    contender: Contender
    world: DynamicCfg
    trial: Trial = field(repr=False)

    @property
    def key(self) -> TrialKey:
        """Of the row that it will be."""
        trial = self.trial
        return (
            self.contender.name,
            self.world.speed_m_s,
            trial.motion,
            trial.object_name,
            trial.seed,
            trial.number,
        )

    def run(self) -> TrialRecord:
        """Run it."""
        with one_thread():
            record = run_trial(self.world, self.trial, self.method)
        return replace(record, method=self.contender.name)

    @property
    def method(self) -> DynamicGrasper:
        """Who grasps; networks are told the class of motion, as in the thesis."""
        cfg = self.contender.cfg
        told = {"circular": "circular", "sinusoidal": "sinusoidal"}.get(self.trial.motion, "linear")
        if cfg.predictor in NETWORKS:
            cfg = replace(cfg, motion_class=told)
        is_shipped = self.world.models == "primitive" and self.world.grasps is None
        return DynamicGrasper(cfg, ranking_aids(self.world.robot, self.trial.object_name if is_shipped else None))


@cache
def ranking_aids(robot: str, object_name: str | None) -> RankingAids:
    """What the package knows of an arm and an object beside its grasps: a reachability field, a motion-aware scorer."""
    return RankingAids(
        reachability_field(robot) if robot in shipped_fields() else None,
        motion_aware_scorer(object_name) if object_name in shipped_scorers() else None,
    )


def evaluate(
    plan: Plan,
    out: Path,
    *,
    workers: int = 1,
    on_trial: Callable[[TrialRecord], None] = lambda record: None,
    run: Callable[[Job], TrialRecord] = Job.run,
) -> list[TrialRecord]:
    """Run what is not in the folder's table yet; each row is written as its trial ends.

    Args:
        plan: What to run.
        out: The folder: ``trials.csv`` and the settings that its rows were made with.
        workers: Processes.
        on_trial: Called after each trial, also with those that were there.
        run: Runs a job.

    Returns:
        All rows of the table, those of other plans in the same folder too.

    Raises:
        ConfigError: The folder's rows were made with other settings.
        StorageError: A file cannot be written.
        WorkerDiedError: A process was killed or crashed; go on with the same command.
    """
    check_settings(plan, out)
    with TrialLog(out) as log:
        jobs = list(plan.jobs())
        write_lists(out, [job.trial for job in jobs])
        for job in jobs:
            if job.key in log.records:
                on_trial(log.records[job.key])
        left = [job for job in jobs if job.key not in log.records]
        for record in _run_all(left, workers, run):
            log.append(record)
            on_trial(record)
        return list(log.records.values())


def check_settings(plan: Plan, out: Path) -> None:
    """Keep the settings of each method in the folder, and refuse to go on with others: rows would not compare.

    Raises:
        ConfigError: They differ.
        StorageError: They cannot be written.
    """
    make_folder(out)
    for contender in plan.contenders:
        world = {name: value for name, value in asdict(contender.world).items() if name != "speed_m_s"}
        now = json.loads(json.dumps({"world": world, "grasper": asdict(contender.cfg)}))
        path = out / f"settings-{contender.name}.json"
        if not path.is_file():
            write_atomically(path, json.dumps(now, indent=2) + "\n")
            continue
        before = json.loads(path.read_text(encoding="utf-8"))
        if before != now:
            differing = [
                f"{part}.{name}"
                for part in now
                for name in now[part]
                if before.get(part, {}).get(name) != now[part][name]
            ]
            raise ConfigError(
                f"{out} holds trials of {contender.name!r} with other settings ({', '.join(differing)}); name another"
                " folder (--out) or another name (--label)."
            )


def write_lists(out: Path, trials: Sequence[Trial]) -> None:
    """Keep the trials themselves: paths, headings, obstacles."""
    unique = {(t.motion, t.object_name, t.seed, t.number): t.as_json() for t in trials}
    write_atomically(out / LISTS_FILE, json.dumps(list(unique.values())) + "\n")


def read_lists(path: Path) -> list[Trial]:
    """The trials that :func:`write_lists` kept.

    Raises:
        ConfigError: No such file, or no list of trials.
    """
    try:
        return [Trial.from_json(data) for data in json.loads(path.read_text(encoding="utf-8"))]
    except (OSError, ValueError) as error:
        raise (
            error if isinstance(error, ConfigError) else ConfigError(f"{path} is no list of trials: {error}.")
        ) from None


def _run_all(jobs: Sequence[Job], workers: int, run: Callable[[Job], TrialRecord]) -> Iterator[TrialRecord]:
    if workers <= 1:
        yield from map(run, jobs)
        return
    # A forked child inherits the locks of a simulator that its parent has loaded, and hangs.
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(min(workers, max(len(jobs), 1)), context, initializer=_ignore_interrupts)
    waiting: set[Future[TrialRecord]] = set()
    try:
        todo = iter(jobs)
        for job in todo:
            waiting.add(pool.submit(run, job))
            if len(waiting) < 2 * workers:
                continue
            done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
            yield from (future.result() for future in done)
        while waiting:
            done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
            yield from (future.result() for future in done)
    except BrokenProcessPool:
        raise WorkerDiedError(
            "a process that ran trials died; those that were over are kept, the same command goes on with the rest."
        ) from None
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _ignore_interrupts() -> None:
    """Ctrl-C reaches every process of a terminal; the parent is the one that answers it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
