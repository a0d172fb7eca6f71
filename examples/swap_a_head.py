"""Other critics on the same encoder and actor: by a setting, or your own."""

from __future__ import annotations

from dataclasses import replace

import torch
from tensordict import TensorDict
from torch import nn
from torchrl.modules import ValueOperator

from tr_grasp.configs import TrainCfg
from tr_grasp.keys import ACTION, CRITIC_FEATURES, OCTREE, PROPRIO, STAGES
from tr_grasp.modules import Agent, EnvSpec, TargetUpdate, build_agent, build_loss
from tr_grasp.modules.encoders import default_spec
from tr_grasp.modules.export import random_observations
from tr_grasp.octree import OctreeFrame

ENV = EnvSpec(octree=default_spec(), stack_n=1)


def observations(n: int, seed: int) -> dict:
    """Made-up observations with the keys and shapes of the task's."""
    codes, features, proprio = random_observations(ENV, n, seed)
    return {OCTREE: OctreeFrame(codes, features, batch_size=[n, 1]), PROPRIO: proprio, STAGES: torch.zeros(n, 4)}


def update(cfg: TrainCfg, agent: Agent, n: int = 16) -> dict[str, float]:
    """One gradient step on made-up transitions."""
    over = torch.zeros(n, 1, dtype=torch.bool)
    following = observations(n, 1) | {"reward": torch.randn(n, 1), "done": over, "terminated": over}
    batch = TensorDict({**observations(n, 0), ACTION: torch.rand(n, 5) * 2 - 1, "next": following}, [n])
    loss = build_loss(cfg, agent)
    targets, optimiser = TargetUpdate(loss, tau=0.01), torch.optim.Adam(loss.parameters(), lr=1e-3)
    losses = loss(batch)
    (losses["loss_qvalue"] + losses["loss_actor"] + losses["loss_alpha"]).backward()
    optimiser.step()
    targets.step()
    return {name: losses[name].item() for name in ("loss_qvalue", "loss_actor")}


def main() -> dict[str, dict[str, float]]:
    """Losses with the default critics, with dueling ones, and with bilinear ones."""
    torch.manual_seed(0)
    cfg = TrainCfg()
    dueling = replace(cfg, network=replace(cfg.network, heads="dueling"))  # or: tr-grasp train grasp --heads dueling
    agents = {"default": build_agent(cfg, ENV), "dueling": build_agent(dueling, ENV), "bilinear": build_agent(cfg, ENV)}
    agents["bilinear"].critics = [  # yours: any module from features and action to quantiles
        ValueOperator(nn.Bilinear(128, 5, 25), [CRITIC_FEATURES, ACTION], ["state_action_value"]) for _ in range(2)
    ]
    return {name: update(cfg, agent) for name, agent in agents.items()}


if __name__ == "__main__":
    print(*main().items(), sep="\n")
