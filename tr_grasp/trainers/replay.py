"""Uniform replay that stores every observation once.

Two rings: observations (an octree is 8 KiB) and transitions (100 bytes), which name the observations of their stack by
number. A stack is put together when it is sampled.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from tr_grasp.errors import CheckpointError
from tr_grasp.keys import ACTION, DEPTH_IMAGE, EXPERT_ACTION, EXPERT_TARGET, OCTREE, PROPRIO, STAGES
from tr_grasp.octree import OctreeFrame

OBSERVATIONS_PER_TRANSITION = 1.125
"""Usual room: episodes have a last observation too, and a chunk begins with a whole stack. Where episodes are shorter
than ten steps, the oldest transitions give way a little before the capacity is reached."""

OBSERVATIONS_FOR_ANY_LENGTH = 2.25
"""Room for episodes of any length, in chunks of at least a dozen steps."""

_OUTCOME = ("reward", "terminated", "truncated", "done")


class ReplayBuffer:
    """The last ``capacity`` transitions.

    A chunk is what one collector hands over: consecutive steps of one environment. Chunks of several environments may
    alternate, because each one brings the whole first stack of its own.

    The first observation of an episode fills its whole stack, as the environment does it.

    Args:
        capacity: Transitions kept.
        stack_n: Observations in a stack.
        observations_per_transition: How many observations there is room for.
        observed: What of a stack is stored: the keys that an encoder reads. Depth pictures are kept in float16, which
            is right to half a millimetre within a metre.
    """

    def __init__(
        self,
        capacity: int,
        stack_n: int,
        observations_per_transition: float = OBSERVATIONS_PER_TRANSITION,
        observed: Sequence[str] = (OCTREE, PROPRIO),
    ) -> None:
        self.capacity = capacity
        self.stack_n = stack_n
        self.observed = tuple(observed)
        self.observations_capacity = int(capacity * observations_per_transition) + 4 * stack_n
        # Allocated with the first chunk, which shows what is to be stored.
        self._observations = TensorDict(batch_size=[0])
        self._transitions = TensorDict(batch_size=[0])
        self._observations_written = 0
        self._written = 0
        self._oldest = 0

    def __len__(self) -> int:
        return self._written - self._oldest

    @property
    def written(self) -> int:
        """Transitions ever stored."""
        return self._written

    @property
    def bytes_per_transition(self) -> float:
        """Memory of the full buffer, divided by its capacity; 0 before the first chunk."""
        tables = (self._observations, self._transitions)
        return sum(leaf.nbytes for table in tables for leaf in table.values(True, True)) / self.capacity

    def extend(self, chunk: TensorDictBase) -> None:
        """Store consecutive steps of one environment, batch ``(T,)``, as a TorchRL collector returns them.

        Raises:
            ValueError: The chunk does not fit into the buffer, or its stacks have another length.
        """
        order, stacks = _plan(chunk["next", "done"].flatten().tolist(), self.stack_n)
        if chunk[PROPRIO].shape[1] != self.stack_n:
            raise ValueError(f"stacks must have {self.stack_n} observations, got {chunk[PROPRIO].shape[1]}")
        if len(chunk) > self.capacity or len(order) > self.observations_capacity:
            raise ValueError(f"a chunk of {len(chunk)} steps does not fit into a replay of {self.capacity}")
        self._write_observations(_candidates(chunk, self.observed)[order])
        first_number = self._observations_written - len(order)
        self._write_transitions(chunk, stacks + first_number)

    def sample(self, n: int, generator: torch.Generator | None = None) -> TensorDict:
        """``n`` transitions, each stored one equally likely, with replacement.

        Returns:
            Batch ``(n,)``: what is observed, ``(n, stack)``, ``stages`` and ``expert_action`` where stored,
            ``action``, and under ``next`` the same at the following observation with ``reward``, ``terminated``,
            ``truncated`` and ``done``.

        Raises:
            ValueError: The buffer is empty.
        """
        if len(self) == 0:
            raise ValueError("cannot sample from an empty replay buffer")
        return self.get(torch.randint(self._oldest, self._written, (n,), generator=generator))

    def get(self, numbers: Tensor) -> TensorDict:
        """The transitions of these running numbers, which must lie in ``[written - len, written)``."""
        transitions = self._transitions[numbers % self.capacity]
        slots = transitions.pop("stack") % self.observations_capacity
        stacked = self._observations.select(*self.observed)[slots]
        single = self._observations.exclude(*self.observed)
        current = single[slots[:, -2]].update({key: stacked[key][:, :-1] for key in self.observed})
        following = single[slots[:, -1]].update({key: stacked[key][:, 1:] for key in self.observed})
        current.set(ACTION, transitions.pop(ACTION))
        current.set("next", following.update(transitions))
        return current

    def state_dict(self) -> dict[str, Any]:
        """Plain tensors and numbers, of the filled part only."""
        return {
            "capacity": self.capacity,
            "stack_n": self.stack_n,
            "counters": [self._observations_written, self._written, self._oldest],
            "observations": _dump(self._observations, self._observations_written),
            "transitions": _dump(self._transitions, self._written),
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Restore exactly; the same generator then draws the same batches.

        Raises:
            CheckpointError: It is the state of a buffer of another size.
        """
        if (state["capacity"], state["stack_n"]) != (self.capacity, self.stack_n):
            raise CheckpointError(
                f"the stored replay has capacity {state['capacity']} and stacks of {state['stack_n']}, "
                f"the settings ask for {self.capacity} and {self.stack_n}."
            )
        self._observations_written, self._written, self._oldest = state["counters"]
        self._observations = _restore(state["observations"], self.observations_capacity)
        self._transitions = _restore(state["transitions"], self.capacity)

    def _write_observations(self, observations: TensorDict) -> None:
        if self._observations.is_empty():
            self._observations = _allocate(observations, self.observations_capacity)
        slots = torch.arange(len(observations)) + self._observations_written
        self._observations[slots % self.observations_capacity] = observations
        self._observations_written += len(observations)

    def _write_transitions(self, chunk: TensorDictBase, stacks: Tensor) -> None:
        transitions = TensorDict(
            {"stack": stacks, ACTION: chunk[ACTION], **{name: chunk["next", name] for name in _OUTCOME}},
            batch_size=[len(chunk)],
        )
        if self._transitions.is_empty():
            self._transitions = _allocate(transitions, self.capacity)
        self._transitions[(torch.arange(len(chunk)) + self._written) % self.capacity] = transitions
        self._written += len(chunk)
        self._forget()

    def _forget(self) -> None:
        """Give up transitions that were overwritten, or that name an observation that was."""
        self._oldest = max(self._oldest, self._written - self.capacity)
        oldest_observation = self._observations_written - self.observations_capacity
        # Numbers within a stack and from one transition to the next never fall, so the first stack decides.
        first = self._transitions["stack"][:, 0]
        while len(self) and first[self._oldest % self.capacity] < oldest_observation:
            self._oldest += 1


def _plan(done: list[bool], stack_n: int) -> tuple[Tensor, Tensor]:
    """Which observations of a chunk to store, and which of these make up each transition.

    Returns:
        ``order (N,)``, indices into :func:`_candidates`, and ``stacks (T, stack_n + 1)``, positions in ``order``:
        the stack at the beginning of the step and the observation after it.
    """
    steps_n = len(done)
    order = list(range(stack_n))
    stack = list(range(stack_n))
    stacks = []
    for step, is_done in enumerate(done):
        stacks.append([*stack, len(order)])
        stack = stacks[-1][1:]
        order.append(stack_n + step)
        if is_done and step + 1 < steps_n:
            stack = [len(order)] * stack_n
            order.append(stack_n + steps_n + step + 1)
    return torch.tensor(order), torch.tensor(stacks)


def _candidates(chunk: TensorDictBase, observed: Sequence[str]) -> TensorDict:
    """Single observations: the first stack, the one after each step, and the one before each step."""
    single = [key for key in (STAGES, EXPERT_ACTION, EXPERT_TARGET) if key in chunk and key in chunk["next"]]
    newest = [_newest(part, observed, single) for part in (chunk["next"], chunk)]
    first = chunk[:1]
    stack_n = chunk[PROPRIO].shape[1]
    first_stack = TensorDict(
        {
            **{key: _kept(key, first[key][0]) for key in observed},
            # Of a stack only the newest one is ever asked for these.
            **{key: first[key].expand(stack_n, -1) for key in single},
        },
        batch_size=[stack_n],
    )
    return torch.cat([first_stack, *newest])


def _newest(observation: TensorDictBase, observed: Sequence[str], single: list[str]) -> TensorDict:
    newest = {key: _kept(key, observation[key][:, -1]) for key in observed}
    return TensorDict(newest | {key: observation[key] for key in single}, batch_size=observation.batch_size)


def _kept(key: str, value: Any) -> Any:
    return value.half() if key == DEPTH_IMAGE else value


def _leaves(table: TensorDictBase) -> dict[str, Tensor]:
    """Every tensor under a plain name, ``octree/codes`` for one inside the octree."""
    names = {key: "/".join(key) if isinstance(key, tuple) else key for key in table.keys(True, True)}
    return {name: table[key] for key, name in names.items()}


def _table(leaves: Mapping[str, Tensor]) -> TensorDict:
    """The inverse of :func:`_leaves`."""
    rows_n = len(next(iter(leaves.values()), ()))
    octree = {name.removeprefix(f"{OCTREE}/"): leaf for name, leaf in leaves.items() if name.startswith(f"{OCTREE}/")}
    entries: dict[str, Any] = {name: leaf for name, leaf in leaves.items() if "/" not in name}
    if octree:
        entries[OCTREE] = OctreeFrame(**octree, batch_size=[rows_n])
    return TensorDict(entries, batch_size=[rows_n])


def _allocate(example: TensorDictBase, rows_n: int) -> TensorDict:
    """An uninitialised table: the operating system gives the memory when it is written, which zeros would do now."""
    shapes = {name: (leaf.shape[1:], leaf.dtype) for name, leaf in _leaves(example).items()}
    return _table({name: torch.empty((rows_n, *shape), dtype=dtype) for name, (shape, dtype) in shapes.items()})


def _dump(table: TensorDict, written: int) -> dict[str, Tensor]:
    # A slice would be saved with all of its storage.
    return {name: leaf if written >= len(leaf) else leaf[:written].clone() for name, leaf in _leaves(table).items()}


def _restore(dump: Mapping[str, Tensor], rows_n: int) -> TensorDict:
    filled = _table(dump)
    if len(filled) in (0, rows_n):
        return filled
    table = _allocate(filled, rows_n)
    table[: len(filled)] = filled
    return table
