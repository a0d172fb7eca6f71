"""Episodes worth looking at, played again with the camera running."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import zip_longest
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.envs import EnvBase

from tr_grasp.envs import GraspNovelObjectsEnv, Outcome
from tr_grasp.evaluation.players import Policy
from tr_grasp.evaluation.records import EpisodeRecord
from tr_grasp.evaluation.rollouts import run_episode
from tr_grasp.evaluation.suites import Suite
from tr_grasp.keys import OCTREE, OUTCOME, PROPRIO, STAGES
from tr_grasp.octree import OctreeFrame

IMAGE_PX = 320
ViewCamera = Literal["raycast", "sapien"]
"""Who draws the scene: the ray caster, or SAPIEN's renderer where there is a Vulkan device."""


@dataclass(frozen=True, eq=False)
class ReplayStep:
    """One instant of an episode."""

    step: int
    """Policy steps so far."""
    image: NDArray[np.uint8]
    """``(h, w, 3)`` picture of the scene."""
    octree: OctreeFrame
    """The newest octree that the policy was given (batch ``[]``)."""
    proprio: NDArray[np.float32]
    """``(10,)`` the newest proprioception."""
    action: NDArray[np.float32] | None
    """``(5,)`` the action that led here; None at the start."""
    stages: tuple[bool, ...]
    """Reach, touch, grasp and lift so far."""
    outcome: str
    """What became of the episode, as if it ended now."""


@dataclass
class Recorder:
    """Watches an episode and keeps every instant of it."""

    image_px: int = IMAGE_PX
    camera: ViewCamera = "raycast"
    steps: list[ReplayStep] = field(default_factory=list)

    def __call__(self, env: EnvBase, step: int, action: Tensor | None, state: TensorDictBase) -> None:
        """Keep one instant; see ``rollouts.Watch``."""
        self.steps.append(
            ReplayStep(
                step=step,
                image=self._picture(env.task),
                octree=state[OCTREE][-1].clone(),
                proprio=state[PROPRIO][-1].numpy().copy(),
                action=None if action is None else action.numpy().copy(),
                stages=tuple(bool(flag) for flag in state[STAGES]),
                outcome=Outcome(int(state[OUTCOME])).label,
            )
        )

    def _picture(self, task: GraspNovelObjectsEnv) -> NDArray[np.uint8]:
        return task.render_image(self.image_px) if self.camera == "raycast" else task.photograph(self.image_px)


def record_episode(
    env: EnvBase, policy: Policy, suite: Suite, episode: int, camera: ViewCamera = "raycast"
) -> tuple[EpisodeRecord, list[ReplayStep]]:
    """Play an episode again. Recording changes nothing: the record equals that of the first time."""
    recorder = Recorder(camera=camera)
    record = run_episode(env, policy, suite, episode, recorder)
    return record, recorder.steps


def choose_episodes(records: Iterable[EpisodeRecord], n: int) -> list[EpisodeRecord]:
    """Episodes to show of one suite: half failures, one of each kind before a second of any, half successes.

    Where one half has too few, the other fills up.
    """
    records = list(records)
    failures = _one_of_each_first([r for r in records if not r.success])
    successes = [r for r in records if r.success]
    mixed = [r for pair in zip_longest(failures, successes) for r in pair if r is not None]
    return sorted(mixed[:n], key=lambda record: (record.success, record.episode))


def _one_of_each_first(failures: Sequence[EpisodeRecord]) -> list[EpisodeRecord]:
    seen: dict[str, int] = {}
    rounds = []
    for record in failures:
        seen[record.outcome] = seen.get(record.outcome, 0) + 1
        rounds.append(seen[record.outcome])
    order = sorted(range(len(failures)), key=lambda index: (rounds[index], index))
    return [failures[index] for index in order]
