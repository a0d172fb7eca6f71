"""Play episodes in several processes that share nothing."""

from __future__ import annotations

import multiprocessing
import signal
import traceback
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from itertools import islice
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import TYPE_CHECKING, cast

from tr_grasp.errors import TrGraspError
from tr_grasp.evaluation.records import EpisodeRecord
from tr_grasp.evaluation.rollouts import one_thread, run_episode
from tr_grasp.evaluation.suites import Suite

if TYPE_CHECKING:
    from torchrl.envs import EnvBase

    from tr_grasp.configs import EnvCfg
    from tr_grasp.evaluation.players import Player

Job = tuple[int, int]
"""Suite index and episode."""


class WorkerDiedError(TrGraspError, RuntimeError):
    """A process that played episodes ended by itself."""


def run_in_processes(
    suites: Sequence[Suite],
    player: str,
    workers: int,
    make_env: Callable[[EnvCfg], EnvBase],
    load: Callable[[str], Player],
) -> Generator[EpisodeRecord, None, None]:
    """As ``rollouts.run_suites``, in that many processes; an idle one gets the next episode.

    Raises:
        WorkerDiedError: If a process was killed or crashed.
        TrGraspError: What a process raised.
    """
    jobs = iter([(index, episode) for index, suite in enumerate(suites) for episode in range(suite.episodes)])
    # A forked child inherits the locks of a simulator that its parent has loaded, and hangs.
    context = multiprocessing.get_context("spawn")
    pipes: list[Connection] = []
    processes: list[BaseProcess] = []
    try:
        for job in islice(jobs, workers):
            ours, theirs = context.Pipe()
            process = context.Process(target=_serve, args=(theirs, suites, player, make_env, load), daemon=True)
            with _interrupts_blocked():
                process.start()
            theirs.close()
            processes.append(process)
            pipes.append(ours)
            ours.send(job)
        yield from _collect(pipes, jobs)
    finally:
        for process in processes:
            process.terminate()
        for process in processes:
            process.join()


def _collect(pipes: list[Connection], jobs: Iterator[Job]) -> Iterator[EpisodeRecord]:
    busy = list(pipes)
    while busy:
        for pipe in cast("list[Connection]", wait(busy)):
            try:
                result = pipe.recv()
                if isinstance(result, Exception):
                    raise result
                job = next(jobs, None)
                if job is None:
                    busy.remove(pipe)
                else:
                    pipe.send(job)
            except (EOFError, BrokenPipeError):
                raise WorkerDiedError(
                    "a worker process died; if memory ran out, try fewer of them (--workers 1)."
                ) from None
            yield result


@contextmanager
def _interrupts_blocked() -> Iterator[None]:
    """Ctrl-C reaches every process of a terminal; a child started in here never hears it, and we hear it after."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _serve(
    pipe: Connection,
    suites: Sequence[Suite],
    player: str,
    make_env: Callable[[EnvCfg], EnvBase],
    load: Callable[[str], Player],
) -> None:
    try:
        with one_thread():
            _play_jobs(pipe, suites, player, make_env, load)
    except (EOFError, BrokenPipeError):
        return  # The parent is gone.
    except TrGraspError as error:
        pipe.send(error)
    except Exception:
        pipe.send(RuntimeError(f"a worker process failed:\n{traceback.format_exc()}"))


def _play_jobs(
    pipe: Connection,
    suites: Sequence[Suite],
    player: str,
    make_env: Callable[[EnvCfg], EnvBase],
    load: Callable[[str], Player],
) -> None:
    policy = load(player).policy
    current, env = -1, None
    while True:
        index, episode = pipe.recv()
        if index != current or env is None:
            if env is not None:
                env.close()
            current, env = index, make_env(suites[index].env)
        pipe.send(run_episode(env, policy, suites[index], episode))
