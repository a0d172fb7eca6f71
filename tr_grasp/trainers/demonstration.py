"""One recorded episode, each of its observations held once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from tr_grasp.keys import ACTION, EXPERT_ACTION, EXPERT_TARGET, OCTREE, PROPRIO, STAGES
from tr_grasp.octree import OctreeFrame

OBSERVATION_ARRAYS = ("codes", "features", PROPRIO, STAGES, EXPERT_ACTION, EXPERT_TARGET)
"""One row for each observation, the last one of the episode included; those that the environment does not give are
missing."""

STEP_ARRAYS = (ACTION, "reward", "terminated", "truncated")
"""One row for each step."""

_FRAME = ("codes", "features")


@dataclass(frozen=True)
class EpisodeInfo:
    """What became of an episode, and where it comes from."""

    seed: int
    """Decides the scene and the expert's noise."""
    success: bool
    """An object was lifted."""
    outcome: str
    """In words."""
    steps: int
    """Policy steps."""
    reward: float
    """Sum of the rewards."""
    objects: tuple[str, ...]
    """Names of the objects."""
    commit: str
    """Commit of the source tree that recorded it; empty outside of one."""


@dataclass(frozen=True, eq=False)
class Demonstration:
    """An episode of ``T`` steps, ``T + 1`` observations."""

    info: EpisodeInfo
    arrays: Mapping[str, NDArray]
    """``codes`` (T+1, leaves), ``features`` (T+1, leaves, channels), and under the names of :mod:`tr_grasp.keys`
    ``proprio`` (T+1, 10), ``stages`` (T+1, 4), ``expert_action`` (T+1, 5), ``expert_target`` (T+1, 6), ``action``
    (T, 5), ``reward``, ``terminated`` and ``truncated`` (T, 1)."""

    def chunk(self, stack_n: int) -> TensorDict:
        """The episode as a collector hands it over, with stacks of any length.

        Returns:
            Batch ``(T,)``, the observation before each step and under ``next`` the one after it. The first observation
            fills its whole stack, as in the environment.
        """
        tensors = {name: torch.from_numpy(np.ascontiguousarray(array)) for name, array in self.arrays.items()}
        observations_n = self.info.steps + 1
        window = (torch.arange(observations_n)[:, None] + torch.arange(1 - stack_n, 1)).clamp(min=0)
        octree = OctreeFrame(**{name: tensors[name][window] for name in _FRAME}, batch_size=list(window.shape))
        single = {name: tensors[name] for name in OBSERVATION_ARRAYS if name in tensors and name not in _FRAME}
        stacked = {OCTREE: octree, PROPRIO: tensors[PROPRIO][window]}
        observed = TensorDict({**single, **stacked}, batch_size=[observations_n])
        paid = {name: tensors[name] for name in STEP_ARRAYS if name != ACTION}
        chunk = observed[:-1]
        chunk.set(ACTION, tensors[ACTION])
        chunk.set("next", observed[1:].update({**paid, "done": paid["terminated"] | paid["truncated"]}))
        return chunk


class EpisodeTape:
    """Takes down an episode while it is played: ``watch`` is a ``Watch`` of :mod:`tr_grasp.evaluation.rollouts`."""

    def __init__(self) -> None:
        self._observations: list[dict[str, Tensor]] = []
        self._steps: list[dict[str, Tensor]] = []

    def watch(self, _env: object, _step: int, action: Tensor | None, state: TensorDictBase) -> None:
        """Note the state that a step led to; the first one comes without an action."""
        newest = {name: getattr(state[OCTREE], name)[-1] for name in _FRAME} | {PROPRIO: state[PROPRIO][-1]}
        single = (STAGES, EXPERT_ACTION, EXPERT_TARGET)
        self._observations.append(newest | {name: state[name].clone() for name in single if name in state})
        if action is not None:
            paid = {name: state[name].clone() for name in STEP_ARRAYS if name != ACTION}
            self._steps.append({ACTION: action.clone(), **paid})

    def arrays(self) -> dict[str, NDArray]:
        """What was noted, as :attr:`Demonstration.arrays`."""
        rows = {**_stacked(self._observations), **_stacked(self._steps)}
        return {name: tensor.numpy() for name, tensor in rows.items()}


def _stacked(rows: list[dict[str, Tensor]]) -> dict[str, Tensor]:
    return {name: torch.stack([row[name] for row in rows]) for name in rows[0]}
