"""A gradient step: ``python -m benchmarks.learner``.

Prints JSON rows. Peer, if ``ocnn`` is installed: the same step of the thesis' network on ocnn's layers, with an encoder
of its own inside the actor and inside each critic, as in drl_grasping; merging its octrees is part of the step.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from tensordict import TensorDict
from torch import Tensor, nn

from benchmarks import _ocnn
from benchmarks._common import SPEC, print_row, tabletop_cloud, tabletop_frames, timings
from tr_grasp.configs import TrainCfg
from tr_grasp.configs.io import load_train_cfg
from tr_grasp.modules import EnvSpec, build_agent
from tr_grasp.modules.heads import mlp
from tr_grasp.trainers.learner import Learner

ACTION_N, PROPRIO_N, STAGES_N = 5, 10, 4


def settings(encoder: str, node_set: str, stack_n: int) -> TrainCfg:
    """Our recipe with that network."""
    cfg = load_train_cfg("grasp")
    observation = replace(cfg.env.observation, stack_n=stack_n)
    network = replace(cfg.network, encoder=encoder, node_set=node_set, shared_stack=False)
    return replace(cfg, env=replace(cfg.env, observation=observation), network=network)


def random_batch(batch_n: int, stack_n: int) -> TensorDict:
    """Transitions with octrees of a table and boxes; the next stack is this one moved on by one frame, as in use."""
    tool = torch.tensor([1.0, *SPEC.centre_m, 1.0, 0.0, 0.0, 0.0, -1.0, 0.0])
    frames = tabletop_frames(64)[torch.randint(64, (batch_n, stack_n + 1))]

    def observation(first: int) -> dict[str, Any]:
        return {
            "octree": frames[:, first : first + stack_n].clone(),
            "proprio": tool + torch.randn(batch_n, stack_n, PROPRIO_N) * 0.01,
            "stages": torch.zeros(batch_n, STAGES_N),
        }

    ends = torch.rand(batch_n, 1) < 0.1
    step = {"reward": torch.rand(batch_n, 1), "terminated": ends, "truncated": torch.zeros_like(ends), "done": ends}
    return TensorDict(
        {
            **observation(0),
            "action": torch.rand(batch_n, ACTION_N) * 2 - 1,
            "expert_action": torch.rand(batch_n, ACTION_N) * 2 - 1,
            "expert_target": torch.rand(batch_n, 6),
            "imitation_weight": torch.ones(batch_n),
            "next": observation(1) | step,
        },
        batch_size=[batch_n],
    )


def our_step(encoder: str, node_set: str, stack_n: int, batch_n: int) -> Callable[[], object]:
    """An update of the project's learner, imitation included."""
    cfg = settings(encoder, node_set, stack_n)
    agent = build_agent(cfg, EnvSpec(octree=SPEC, stack_n=stack_n))
    learner = Learner(agent, cfg, Path(tempfile.gettempdir()))
    batch = random_batch(batch_n, stack_n)
    return lambda: learner.update(batch.clone(), env_steps=0)


class PeerNetwork(nn.Module):
    """An encoder for each stacked observation, then a head."""

    def __init__(self, ocnn: Any, stack_n: int, nempty: bool, extra_n: int, out_n: int) -> None:
        super().__init__()
        self.encoders = nn.ModuleList(_ocnn.VanillaPeer(ocnn, nempty) for _ in range(stack_n))
        self.head = mlp(stack_n * (160 + PROPRIO_N) + extra_n, (256, 256), out_n)

    def forward(self, octrees: list[Any], *extra: Tensor) -> Tensor:
        """Octrees of each stacked observation, then proprioception and, for critics, the action."""
        features = [encoder(octree) for encoder, octree in zip(self.encoders, octrees, strict=True)]
        return self.head(torch.cat([*features, *extra], dim=1))


def peer_step(ocnn: Any, nempty: bool, stack_n: int, batch_n: int) -> Callable[[], None]:
    """The TQC step with eight encoder passes: actor at both ends, targets, critics, critics at the policy's action."""
    rng = np.random.default_rng(0)
    pool = [_ocnn.build_octree(ocnn, tabletop_cloud(rng), SPEC) for _ in range(64)]
    stacks = [[[pool[i] for i in rng.integers(64, size=batch_n)] for _ in range(stack_n)] for _ in range(2)]
    actor = PeerNetwork(ocnn, stack_n, nempty, 0, 2 * ACTION_N)
    critics, targets = (
        nn.ModuleList(PeerNetwork(ocnn, stack_n, nempty, ACTION_N, 25) for _ in range(2)) for _ in range(2)
    )
    targets.requires_grad_(False)
    optimiser = torch.optim.Adam([*actor.parameters(), *critics.parameters()], lr=1e-4)
    proprio, action = torch.randn(batch_n, stack_n * PROPRIO_N), torch.randn(batch_n, ACTION_N)
    reward = torch.rand(batch_n, 1)
    levels = ((torch.arange(25) + 0.5) / 25)[:, None]

    def act(octrees: list[Any]) -> tuple[Tensor, Tensor]:
        mean, log_std = actor(octrees, proprio).chunk(2, dim=1)
        noise = torch.randn_like(mean)
        sample = torch.tanh(mean + log_std.clamp(-20, 2).exp() * noise)
        return sample, (-0.5 * noise**2 - log_std - (1 - sample**2 + 1e-6).log()).sum(1, keepdim=True)

    def step() -> None:
        now, following = ([_ocnn.merge(ocnn, octrees) for octrees in stack] for stack in stacks)
        with torch.no_grad():
            next_action, log_prob = act(following)
            atoms = torch.cat([target(following, proprio, next_action) for target in targets], dim=1).sort(1)[0][:, :46]
            y = reward + 0.99 * (atoms - 0.1 * log_prob)
        loss = torch.zeros(())
        for critic in critics:
            u = y[:, None, :] - critic(now, proprio, action)[:, :, None]
            huber = torch.where(u.abs() <= 1, 0.5 * u**2, u.abs() - 0.5)
            loss = loss + ((levels - (u < 0).float()).abs() * huber).mean()
        policy_action, log_prob = act(now)
        critics.requires_grad_(False)
        values = torch.stack([critic(now, proprio, policy_action) for critic in critics])
        critics.requires_grad_(True)
        loss = loss + (0.1 * log_prob).mean() - values.mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        with torch.no_grad():
            torch._foreach_lerp_(list(targets.parameters()), list(critics.parameters()), 5e-5)

    return step


def main() -> None:
    """Read the flags and run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--repeats", type=int, default=9)
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    torch.manual_seed(0)
    (ms,) = timings(our_step("localising_ocnn", "occupied", 1, 64), repeats=args.repeats)
    print_row("gradient step, localising_ocnn, 1 observation", ms, batch=64)
    ocnn = _ocnn.import_ocnn()
    for node_set in ("occupied", "siblings"):
        name = f"gradient step, vanilla_ocnn ({node_set}), 3 observations"
        steps = [our_step("vanilla_ocnn", node_set, 3, 32)]
        if ocnn is not None:
            steps.append(peer_step(ocnn, node_set == "occupied", 3, 32))
        times = timings(*steps, repeats=args.repeats)
        peer = ("ocnn, encoder inside actor and critics", times[1]) if ocnn is not None else (None, None)
        print_row(name, times[0], *peer, batch=32)


if __name__ == "__main__":
    main()
