"""Who acts while transitions are collected: the policy with noise, or the scripted expert with more of it."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase

from tr_grasp.keys import ACTION, EXPERT_ACTION

STEP_COUNT = "step_count"
"""int64 ``(1,)``: steps since the episode began, as TorchRL's ``StepCounter`` writes it."""


class NoisyPolicy(TensorDictModuleBase):
    """A policy whose actions carry Gaussian noise."""

    def __init__(self, policy: TensorDictModuleBase, noise: float) -> None:
        self.in_keys, self.out_keys = list(policy.in_keys), [ACTION]
        super().__init__()
        self.policy = policy
        self.noise = noise

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write ``action``; noise of 0 draws no random number."""
        action = self.policy(tensordict)[ACTION]
        if self.noise > 0:
            action = (action + self.noise * torch.randn_like(action)).clamp(-1, 1)
        return tensordict.set(ACTION, action)


class ScriptedExpert(TensorDictModuleBase):
    """The expert's action with noise that is drawn anew for each episode, and now and then the wrong gripper command.

    The label ``expert_action`` stays clean, so an imitator learns how to come back from where the noise leads.
    """

    def __init__(self, noise_scale: Sequence[float], gripper_flip_probability: float) -> None:
        self.in_keys, self.out_keys = [EXPERT_ACTION, STEP_COUNT], [ACTION]
        super().__init__()
        self.noise_scale = tuple(noise_scale)
        self.gripper_flip_probability = gripper_flip_probability
        self._episode_noise = 0.0

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write ``action`` for one environment."""
        if int(tensordict[STEP_COUNT]) == 0 and self.noise_scale:
            self._episode_noise = self.noise_scale[int(torch.randint(len(self.noise_scale), ()))]
        action = tensordict[EXPERT_ACTION].clone()
        action[:-1] += self._episode_noise * torch.randn_like(action[:-1])
        if torch.rand(()) < self.gripper_flip_probability:
            action[-1] = -action[-1]
        return tensordict.set(ACTION, action.clamp(-1, 1))


class RandomActions(TensorDictModuleBase):
    """Uniform in [-1, 1]."""

    def __init__(self, action_n: int) -> None:
        self.in_keys, self.out_keys = [], [ACTION]
        super().__init__()
        self.action_n = action_n

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write ``action``."""
        return tensordict.set(ACTION, 2 * torch.rand(self.action_n) - 1)
