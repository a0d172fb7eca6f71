"""Who acts while transitions are collected: the policy with noise, or the scripted expert with more of it."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor
from torchrl.envs.utils import ExplorationType, set_exploration_type

from tr_grasp.keys import ACTION, EXPERT_ACTION, OPEN

STEP_COUNT = "step_count"
"""int64 ``(1,)``: steps since the episode began, as TorchRL's ``StepCounter`` writes it."""


class ExploringPolicy(TensorDictModuleBase):
    """A policy that explores in some episodes and acts deterministically in the others.

    A policy that is trained only on what its noise leads to never learns from the states in which its mean gets stuck.
    For the same reason the policy that will be judged acts without exploring: the running mean of the weights gets
    stuck in other states than the latest ones.

    Args:
        policy: The policy; TorchRL's exploration type decides whether it samples.
        noise: Standard deviation of the Gaussian noise on its sampled actions.
        deterministic_share: Share of episodes without exploration, drawn when an episode begins.
        judged: The policy of these episodes; ``policy`` if not given.
    """

    def __init__(
        self,
        policy: TensorDictModuleBase,
        noise: float,
        deterministic_share: float = 0.0,
        judged: TensorDictModuleBase | None = None,
    ) -> None:
        self.in_keys, self.out_keys = [*policy.in_keys, STEP_COUNT], [ACTION]
        super().__init__()
        self.policy = policy
        self.judged = policy if judged is None else judged
        self.noise = noise
        self.deterministic_share = deterministic_share
        self._is_deterministic = torch.zeros(())

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write ``action`` for one environment, or a batch of them; shares and noise of 0 draw no random number."""
        if self.deterministic_share > 0:
            begins = _begins(tensordict)
            drawn = (torch.rand(int(begins.sum())) < self.deterministic_share).float()
            self._is_deterministic = _redrawn(self._is_deterministic, begins, drawn)
        is_deterministic = self._is_deterministic.bool().expand(tensordict.batch_size)
        if is_deterministic.all():
            return tensordict.set(ACTION, self._mean(tensordict))
        if not is_deterministic.any():
            return tensordict.set(ACTION, self._sample(tensordict))
        sampled = self._sample(tensordict[~is_deterministic])
        action = sampled.new_empty(*tensordict.batch_size, sampled.shape[-1])
        action[~is_deterministic], action[is_deterministic] = sampled, self._mean(tensordict[is_deterministic])
        return tensordict.set(ACTION, action)

    def _mean(self, tensordict: TensorDictBase) -> Tensor:
        with set_exploration_type(ExplorationType.DETERMINISTIC):
            return self.judged(tensordict)[ACTION]

    def _sample(self, tensordict: TensorDictBase) -> Tensor:
        action = self.policy(tensordict)[ACTION]
        return (action + self.noise * torch.randn_like(action)).clamp(-1, 1) if self.noise > 0 else action


class ScriptedExpert(TensorDictModuleBase):
    """The expert's action with noise that is drawn anew for each episode, and now and then the wrong gripper command.

    The label ``expert_action`` stays clean, so an imitator learns how to come back from where the noise leads. The
    expert goes straight to its grasp, so nearly all its states lie within centimetres of it, and where the grasp lies
    hardly shows in its actions; an episode may therefore begin with motions at random.

    Args:
        noise_scale: Standard deviations of the noise on motions; an episode draws one. Without any there is no noise.
        gripper_flip_probability: Chance of the wrong gripper command in a step.
        wander_steps: Most random motions, with an open gripper, at the beginning of an episode, which draws how many.
    """

    def __init__(self, noise_scale: Sequence[float], gripper_flip_probability: float, wander_steps: int = 0) -> None:
        self.in_keys, self.out_keys = [EXPERT_ACTION, STEP_COUNT], [ACTION]
        super().__init__()
        self.noise_scale = tuple(noise_scale)
        self.gripper_flip_probability = gripper_flip_probability
        self.wander_steps = wander_steps
        self._episode_noise = torch.zeros(())
        self._episode_wandering = torch.zeros((), dtype=torch.long)

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write ``action`` for one environment, or a batch of them."""
        if self.noise_scale:
            begins = _begins(tensordict)
            drawn = torch.tensor(self.noise_scale)[torch.randint(len(self.noise_scale), (int(begins.sum()),))]
            self._episode_noise = _redrawn(self._episode_noise, begins, drawn)
        action = tensordict[EXPERT_ACTION].clone()
        action[..., :-1] += self._episode_noise[..., None] * torch.randn_like(action[..., :-1])
        flipped = torch.rand(tensordict.batch_size) < self.gripper_flip_probability
        action[..., -1] = torch.where(flipped, -action[..., -1], action[..., -1])
        if self.wander_steps > 0:
            wanders = self._wanders(tensordict)
            action[..., :-1] = torch.where(wanders[..., None], _uniform(action[..., :-1].shape), action[..., :-1])
            action[..., -1] = torch.where(wanders, OPEN, action[..., -1])
        return tensordict.set(ACTION, action.clamp(-1, 1))

    def _wanders(self, tensordict: TensorDictBase) -> Tensor:
        """Whether the episode is still in its random beginning, bool ``(*batch,)``."""
        begins = _begins(tensordict)
        drawn = torch.randint(self.wander_steps + 1, (int(begins.sum()),))
        self._episode_wandering = _redrawn(self._episode_wandering, begins, drawn)
        return tensordict[STEP_COUNT][..., 0] < self._episode_wandering


class RandomActions(TensorDictModuleBase):
    """Uniform in [-1, 1]."""

    def __init__(self, action_n: int) -> None:
        self.in_keys, self.out_keys = [], [ACTION]
        super().__init__()
        self.action_n = action_n

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write ``action`` for one environment, or a batch of them."""
        return tensordict.set(ACTION, _uniform((*tensordict.batch_size, self.action_n)))


def _uniform(shape: Sequence[int]) -> Tensor:
    """Random numbers in [-1, 1]."""
    return 2 * torch.rand(*shape) - 1


def _begins(tensordict: TensorDictBase) -> Tensor:
    """Where an episode begins, bool ``(*batch,)``."""
    return tensordict[STEP_COUNT][..., 0] == 0


def _redrawn(values: Tensor, begins: Tensor, drawn: Tensor) -> Tensor:
    """One value an environment, new where its episode begins."""
    values = values.expand(begins.shape).clone()
    values[begins] = drawn
    return values
