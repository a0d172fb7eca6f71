"""Recording demonstrations of the scripted expert, in this process or in several."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing
from functools import partial
from pathlib import Path

import torch
from torchrl.envs import EnvBase, StepCounter, TransformedEnv

from tr_grasp.envs import Outcome
from tr_grasp.errors import TrGraspError
from tr_grasp.evaluation.rollouts import one_thread, play_episode
from tr_grasp.keys import OUTCOME, SUCCESS
from tr_grasp.provenance import Provenance
from tr_grasp.trainers.acting import ScriptedExpert
from tr_grasp.trainers.collect import EnvMaker, delayed_interrupt
from tr_grasp.trainers.demonstration import Demonstration, EpisodeInfo, EpisodeTape
from tr_grasp.trainers.demonstration_file import (
    DemonstrationFile,
    Recording,
    append_demonstrations,
    check_same_recording,
)

SAVE_EVERY_S = 60.0
"""What a killed process loses at most."""

_make_recorder: Callable[[], Recorder]
_recorder: Recorder | None = None
"""Those of a worker process."""


class Recorder:
    """Records one episode after the other.

    Args:
        recording: What decides an episode beside its seed.
        make_env: Makes the environment.
        commit: Of the source tree.
    """

    def __init__(self, recording: Recording, make_env: EnvMaker, commit: str | None) -> None:
        self._expert = ScriptedExpert(recording.noise_scale, recording.gripper_flip_probability, recording.wander_steps)
        self._env = TransformedEnv(make_env(recording.env, 0), StepCounter(recording.episode_steps))
        self._commit = commit or ""

    def record(self, seed: int) -> Demonstration:
        """The episode of a seed: the same one whatever was recorded before it, in whichever process."""
        tape = EpisodeTape()
        end, steps, reward = play_episode(self._env, self._expert, seed, tape.watch)
        info = EpisodeInfo(
            seed=seed,
            success=bool(end[SUCCESS]),
            outcome=Outcome(int(end[OUTCOME])).label,
            steps=steps,
            reward=reward,
            objects=_object_names(self._env),
            commit=self._commit,
        )
        return Demonstration(info, tape.arrays())

    def close(self) -> None:
        """End the simulation."""
        self._env.close()


def record_demonstrations(
    path: Path,
    recording: Recording,
    seeds: Sequence[int],
    origin: Provenance,
    *,
    make_env: EnvMaker,
    workers: int = 1,
    on_episode: Callable[[EpisodeInfo], None] = lambda info: None,
) -> DemonstrationFile:
    """Record the episodes of ``seeds`` that the file does not have yet; the file is saved every minute.

    Ctrl-C, and any error, saves what there is and goes on its way.

    Args:
        path: The file; begun if it is not there.
        recording: How to record.
        seeds: One for each episode.
        origin: Where the recording comes from.
        make_env: Makes an environment; must be picklable for several workers.
        workers: Processes; 1 records in this one. The file does not depend on it.
        on_episode: Told of every new episode.

    Raises:
        DemonstrationError: The file holds something else.
        StorageError: It could not be written.
    """
    there: set[int] = set()
    if path.exists():
        file = DemonstrationFile(path)
        check_same_recording(file, recording)
        there = {episode.seed for episode in file.episodes}
    missing = [seed for seed in seeds if seed not in there]
    unsaved: list[Demonstration] = []
    saved_at = time.monotonic()
    try:
        for demonstration in _recorded(recording, missing, make_env, origin.commit, min(workers, len(missing))):
            unsaved.append(demonstration)
            on_episode(demonstration.info)
            if time.monotonic() - saved_at > SAVE_EVERY_S:
                append_demonstrations(path, recording, unsaved, origin.versions)
                unsaved, saved_at = [], time.monotonic()
    finally:
        if unsaved:
            append_demonstrations(path, recording, unsaved, origin.versions)
    return DemonstrationFile(path)


def _recorded(
    recording: Recording, seeds: Sequence[int], make_env: EnvMaker, commit: str | None, workers: int
) -> Iterator[Demonstration]:
    if not seeds:
        return
    if workers == 1:
        with one_thread(), closing(Recorder(recording, make_env, commit)) as recorder:
            yield from map(recorder.record, seeds)
        return
    # A forked child inherits the locks of a simulator that its parent has loaded, and hangs.
    context = multiprocessing.get_context("spawn")
    make_recorder = partial(Recorder, recording, make_env, commit)
    pool = ProcessPoolExecutor(workers, context, _start_worker, (make_recorder,))
    try:
        with delayed_interrupt():
            recorded = pool.map(_record_in_worker, seeds)
        yield from recorded
    except BrokenProcessPool:
        raise TrGraspError(
            "a recording process ended by itself; if memory ran out, try fewer of them (--workers 1)."
        ) from None
    finally:
        pool.shutdown(cancel_futures=True)


def _start_worker(make_recorder: Callable[[], Recorder]) -> None:
    global _make_recorder
    torch.set_num_threads(1)
    _make_recorder = make_recorder


def _record_in_worker(seed: int) -> Demonstration:
    global _recorder
    # Not when the worker starts: from there a mistake in the settings would not find its way to the user.
    _recorder = _recorder or _make_recorder()
    return _recorder.record(seed)


def _object_names(env: EnvBase) -> tuple[str, ...]:
    """Of the objects in the scene; none where a test plays without a simulator."""
    task = getattr(env, "task", None)
    return tuple(model.name for model in task.models) if task is not None else ()
