"""Who plays: a saved policy, or one of three that need no training."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModule
from torch import Tensor

from tr_grasp.configs import EnvCfg, TrainCfg
from tr_grasp.errors import ConfigError, unknown_name
from tr_grasp.keys import ACTION, EXPERT_ACTION, PROPRIO
from tr_grasp.modules import load_policy, shipped_policies
from tr_grasp.robots import robot_spec

SCRIPTED = "scripted"
ACTION_N = 5


class Policy(Protocol):
    """Chooses actions."""

    def __call__(self, td: TensorDictBase, /) -> TensorDictBase:
        """Write ``action`` into the observation."""
        ...


@dataclass(frozen=True, eq=False)
class Player:
    """A policy, and the world whose observations and actions it knows."""

    name: str
    policy: Policy
    env: EnvCfg
    training: TrainCfg | None = None
    """The settings it was trained with; None for one that never learned."""


def load_player(name: str) -> Player:
    """Load a player by name.

    Args:
        name: ``scripted``, ``random``, ``zero``, the name of a shipped policy, or the folder of a saved one.

    Raises:
        ConfigError: If there is none of that name.
        CheckpointError: If the folder does not hold a whole policy of this version.
    """
    if name in BUILT_IN:
        function, key = BUILT_IN[name]
        policy = TensorDictModule(function, in_keys=[key], out_keys=[ACTION])
        return Player(name, policy, _sees_expert(EnvCfg(), name == SCRIPTED))
    if name not in shipped_policies() and not Path(name).exists():
        known = unknown_name("policy", name, [*BUILT_IN, *shipped_policies()])
        raise ConfigError(f"{known} The folder of a saved policy works too.")
    policy, training = load_policy(name)
    return Player(name, policy, _sees_expert(training.env, False), training)


def with_robot(player: Player, robot: str | None) -> Player:
    """The same player with another arm.

    Args:
        player: Whom :func:`load_player` gave.
        robot: Name of the arm, or the YAML file of one's own; None changes nothing.

    Raises:
        ConfigError: If there is no such robot, or the player learned on another.
    """
    if robot is None:
        return player
    robot_spec(robot)
    if player.training is not None and robot != player.env.robot:
        raise ConfigError(
            f"--robot {robot}: '{player.name}' learned on {player.env.robot} and plays only there; "
            f"{', '.join(BUILT_IN)} play with any robot."
        )
    return replace(player, env=replace(player.env, robot=robot))


def _sees_expert(env: EnvCfg, labels: bool) -> EnvCfg:
    """Nobody but the expert is shown the expert's action, whatever it was trained with."""
    return replace(env, observation=replace(env.observation, expert_labels=labels))


def _copy_expert(expert_action: Tensor) -> Tensor:
    return expert_action.clone()


def _random_action(proprio: Tensor) -> Tensor:
    return torch.rand(*proprio.shape[:-2], ACTION_N) * 2 - 1


def _zero_action(proprio: Tensor) -> Tensor:
    return proprio.new_zeros(*proprio.shape[:-2], ACTION_N)


BUILT_IN: dict[str, tuple[Callable[[Tensor], Tensor], str]] = {
    SCRIPTED: (_copy_expert, EXPERT_ACTION),
    "random": (_random_action, PROPRIO),
    "zero": (_zero_action, PROPRIO),
}
"""Players that need no file: the function that acts, and the observation that it reads."""
