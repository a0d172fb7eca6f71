"""Collecting transitions, in this process or beside it."""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

import numpy as np
import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torchrl.collectors import BaseCollector, Collector, MultiAsyncCollector
from torchrl.envs import Compose, EnvBase, RewardSum, SerialEnv, StepCounter, TransformedEnv
from torchrl.envs.utils import ExplorationType

from tr_grasp.configs import EnvCfg
from tr_grasp.errors import TrGraspError
from tr_grasp.trainers.ray_collector import start_ray_collector

EnvMaker = Callable[[EnvCfg, int], EnvBase]

EPISODE_REWARD = "episode_reward"


@dataclass(frozen=True)
class CollectPlan:
    """How to collect, until further notice.

    A plan has a ``segment`` number of its own: environments derive the seeds of their episodes from the seed of the
    run, the segment and the worker, so that no episode comes twice, also after a run was resumed.
    """

    make_env: EnvMaker
    env: EnvCfg
    seed: int
    segment: int
    steps_per_batch: int
    mode: Literal["inline", "process", "ray"] = "inline"
    workers_n: int = 1
    envs_per_worker_n: int = 1
    episode_steps: int | None = None
    """Cut episodes here (truncated); None leaves it to the environment."""

    deterministic: bool = False
    """The policy's mean action instead of a sample."""


class Collection:
    """An endless stream of chunks, each of consecutive steps of a worker's environments, and the policy that acts.

    Use it as a context manager: leaving it ends the workers.
    """

    def __init__(self, plan: CollectPlan, policy: TensorDictModuleBase) -> None:
        self._plan = plan
        self._policy = policy
        self._closed = False
        self._collector = self._start()

    def __enter__(self) -> Collection:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def __iter__(self) -> Iterator[TensorDictBase]:
        """Chunks with batch ``(steps_per_batch,)``; ``(envs, steps_per_batch / envs)`` where a worker has several.

        One worker is at most one chunk ahead of the reader.

        Raises:
            TrGraspError: A worker ended by itself, for example because memory ran out.
        """
        try:
            yield from self._collector
        except RuntimeError as error:
            if not (codes := self._exit_codes()):
                raise
            raise TrGraspError(
                f"a collecting process ended unexpectedly (exit code {codes[0]}; -9 often means that memory ran out); "
                "what was saved is whole and the run can be resumed."
            ) from error

    def push_weights(self) -> None:
        """Let the workers act with the weights that the policy has now."""
        if self._plan.mode != "inline":
            self._collector.update_policy_weights_(self._policy)

    def close(self) -> None:
        """End workers and environments; may be called again."""
        if not self._closed:
            self._closed = True
            threads_n = torch.get_num_threads()
            self._collector.shutdown()
            # TorchRL leaves these to the garbage collector, which may come to them only while the program ends.
            for scheme in (getattr(self._collector, "_weight_sync_schemes", None) or {}).values():
                scheme.shutdown()
            # TorchRL gives the workers' threads to this process.
            torch.set_num_threads(threads_n)

    def _exit_codes(self) -> list[int]:
        """Of the workers that are no more, as far as TorchRL has not closed them itself."""
        workers = [worker for worker in getattr(self._collector, "procs", []) if not worker._closed]
        return [worker.exitcode for worker in workers if not worker.is_alive()]

    def _start(self) -> BaseCollector:
        plan = self._plan
        kind = ExplorationType.DETERMINISTIC if plan.deterministic else ExplorationType.RANDOM
        common: dict[str, Any] = {
            "frames_per_batch": plan.steps_per_batch,
            "total_frames": -1,
            "exploration_type": kind,
            # Stateless policies need no extra transforms.
            "auto_register_policy_transforms": False,
        }
        if plan.mode == "inline":
            return Collector(_Worker(plan, 0), self._policy, trust_policy=True, **common)
        makers = [_Worker(plan, index) for index in range(plan.workers_n)]
        if plan.mode == "ray":
            return start_ray_collector(makers, self._policy, **common)
        threads_n = torch.get_num_threads()
        try:
            with delayed_interrupt():
                return _PatientCollector(makers, self._policy, num_threads=threads_n, num_sub_threads=1, **common)
        except TrGraspError as error:
            # TorchRL appends the worker's traceback to the message.
            raise type(error)(str(error).partition("\n\nWorker traceback")[0]) from None


class _PatientCollector(MultiAsyncCollector):
    """TorchRL's queue holds one chunk and a worker throws its chunk away when it stays full for a second."""

    @property
    def _queue_len(self) -> int:
        return self.num_workers


@dataclass(frozen=True)
class _Worker:
    """Makes the environment of one worker, in the process where it will run."""

    plan: CollectPlan
    index: int

    def __call__(self) -> EnvBase:
        plan = self.plan
        seeds = self._seeds()
        if multiprocessing.parent_process() is not None or plan.mode == "ray":
            signal.signal(signal.SIGINT, signal.SIG_IGN)
            torch.set_num_threads(1)
            torch.manual_seed(seeds[0])
        makers = [partial(self._make_env, seed) for seed in seeds]
        return makers[0]() if len(makers) == 1 else SerialEnv(len(makers), makers)

    def _seeds(self) -> list[int]:
        n = self.plan.envs_per_worker_n
        return [worker_seed(self.plan.seed, self.plan.segment, self.index * n + env) for env in range(n)]

    def _make_env(self, seed: int) -> EnvBase:
        env = self.plan.make_env(self.plan.env, seed)
        return TransformedEnv(env, Compose(StepCounter(self.plan.episode_steps), RewardSum()))


def environments_of(chunk: TensorDictBase) -> Sequence[TensorDictBase]:
    """The parts of a chunk, each of consecutive steps of one environment, batch ``(T,)``."""
    return [chunk] if chunk.ndim == 1 else chunk.unbind(0)


def worker_seed(seed: int, segment: int, env: int) -> int:
    """The seed from which an environment, counted over all workers, derives those of its episodes."""
    return int(np.random.SeedSequence([seed, segment, env]).generate_state(1)[0] % 2**31)


@contextmanager
def delayed_interrupt() -> Iterator[None]:
    """Processes started here never see Ctrl-C, which a terminal sends to all; this one sees it afterwards."""
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
