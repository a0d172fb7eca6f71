"""Play seeded episodes and say what happened in each."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing, contextmanager
from typing import NamedTuple, cast

import torch
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.envs import EnvBase
from torchrl.envs.utils import ExplorationType, set_exploration_type

from tr_grasp.configs import EnvCfg
from tr_grasp.envs import Outcome
from tr_grasp.envs import make_env as make_simulation
from tr_grasp.evaluation.players import Player, Policy, load_player
from tr_grasp.evaluation.records import EpisodeRecord
from tr_grasp.evaluation.suites import Suite
from tr_grasp.keys import ACTION, OUTCOME, STAGES, SUCCESS
from tr_grasp.objects import ObjectModel

EnvMaker = Callable[[EnvCfg], EnvBase]
PlayerLoader = Callable[[str], Player]

Watch = Callable[[EnvBase, int, "Tensor | None", TensorDictBase], None]
"""Called as ``watch(env, step, action, state)`` after the reset (step 0, no action) and after every step with the
state that it led to."""


class Played(NamedTuple):
    """One episode."""

    end: TensorDictBase
    """The last state."""
    steps: int
    """Policy steps."""
    reward: float
    """Sum of the rewards."""


def play_episode(env: EnvBase, policy: Policy, seed: int, watch: Watch | None = None) -> Played:
    """Play one deterministic episode.

    The scene, its noise and the policy's sampling follow from ``seed`` alone; the caller's random state is untouched.

    Args:
        env: An environment of batch size ``[]`` that builds a fresh scene at every reset.
        policy: Writes the action; acts with its mean where it could sample.
        seed: Seed of this episode.
        watch: Looks on.
    """
    with torch.random.fork_rng(devices=[]), torch.no_grad(), set_exploration_type(ExplorationType.DETERMINISTIC):
        env.set_seed(seed)
        torch.manual_seed(seed)
        td = env.reset()
        steps, reward = 0, 0.0
        if watch:
            watch(env, 0, None, td)
        while True:
            td = env.step(policy(td))
            state, steps = td["next"], steps + 1
            reward += float(state["reward"])
            if watch:
                watch(env, steps, td[ACTION], state)
            if bool(state["done"]):
                return Played(state, steps, reward)
            td = env.step_mdp(td)


def run_episode(env: EnvBase, policy: Policy, suite: Suite, episode: int, watch: Watch | None = None) -> EpisodeRecord:
    """Play one episode of a suite and describe it."""
    started = time.perf_counter()
    end, steps, reward = play_episode(env, policy, suite.seed(episode), watch)
    reached, touched, grasped, lifted = (bool(flag) for flag in end[STAGES])
    models = cast("Sequence[ObjectModel]", env.task.models)
    return EpisodeRecord(
        suite=suite.name,
        episode=episode,
        seed=suite.seed(episode),
        success=bool(end[SUCCESS]),
        outcome=Outcome(int(end[OUTCOME])).label,
        steps=steps,
        reward=reward,
        objects_n=len(models),
        objects=tuple(model.name for model in models),
        families=tuple(model.family for model in models),
        reached=reached,
        touched=touched,
        grasped=grasped,
        lifted=lifted,
        wall_s=time.perf_counter() - started,
    )


def run_suites(
    suites: Sequence[Suite],
    player: str,
    *,
    workers: int = 1,
    make_env: EnvMaker = make_simulation,
    load: PlayerLoader = load_player,
) -> Generator[EpisodeRecord, None, None]:
    """Play every episode of every suite and yield each as soon as it is over.

    With several workers the episodes finish in another order; the records are the same. Closing the generator
    (also by Ctrl-C) ends the workers; what was yielded before stays valid.

    Args:
        suites: What to play.
        player: Name for ``load``.
        workers: Processes; 1 plays in this one.
        make_env: Builds the world of a suite; must be picklable for several workers.
        load: Loads the player; must be picklable for several workers.
    """
    if workers > 1:
        from tr_grasp.evaluation.workers import run_in_processes

        yield from run_in_processes(suites, player, workers, make_env, load)
        return
    policy = load(player).policy
    with one_thread():
        for suite in suites:
            with closing(make_env(suite.env)) as env:
                for episode in range(suite.episodes):
                    yield run_episode(env, policy, suite, episode)


@contextmanager
def one_thread() -> Iterator[None]:
    """Compute with one thread: sums of floats then come out the same on every machine load and in every worker."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
