"""Who acts while transitions are collected: the policy with noise, or the scripted expert with more of it."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torchrl.envs.utils import ExplorationType, set_exploration_type

from tr_grasp.keys import ACTION, EXPERT_ACTION

STEP_COUNT = "step_count"
"""int64 ``(1,)``: steps since the episode began, as TorchRL's ``StepCounter`` writes it."""


class ExploringPolicy(TensorDictModuleBase):
    """A policy that explores in some episodes and acts deterministically in the others.

    A policy that is trained only on what its noise leads to never learns from the states in which its mean gets stuck.
    For the same reason it is the policy that will be judged that acts without exploring: the running mean of the weights
    gets stuck in other states than the latest ones.

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
        self._is_deterministic = False

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write ``action`` for one environment; shares and noise of 0 draw no random number."""
        if self.deterministic_share > 0 and int(tensordict[STEP_COUNT]) == 0:
            self._is_deterministic = float(torch.rand(())) < self.deterministic_share
        if self._is_deterministic:
            with set_exploration_type(ExplorationType.DETERMINISTIC):
                return tensordict.set(ACTION, self.judged(tensordict)[ACTION])
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
