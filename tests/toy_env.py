"""A tiny environment with the keys of the real one: move the tool to a cloud of points and close the gripper.

Pure torch, about a millisecond a step, so that trainers can be tested without a simulator.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase
from torchrl.data import Binary, Bounded, Categorical, Composite, Unbounded
from torchrl.envs import EnvBase

from tr_grasp.configs import EnvCfg, TrainCfg
from tr_grasp.keys import (
    ACTION,
    COLOUR_IMAGE,
    DEPTH_IMAGE,
    EXPERT_ACTION,
    OCTREE,
    OUTCOME,
    PROPRIO,
    STAGES,
    SUCCESS,
)
from tr_grasp.modules import EnvSpec
from tr_grasp.octree import OctreeFrame, OctreeSpec

REACHED_M = 0.03

PICTURE_PX = 16


def train_cfg(**trainer: Any) -> TrainCfg:
    """A run of a second or two."""
    cfg = TrainCfg()
    observation = replace(cfg.env.observation, leaf_capacity=32, stack_n=2)
    return replace(
        cfg,
        env=replace(cfg.env, observation=observation, episode_steps=12),
        network=replace(cfg.network, features_n=16, actor_hidden_n=(32,), critic_hidden_n=(32,)),
        algorithm=replace(cfg.algorithm, quantiles_n=5, actor_warmup_updates=5),
        replay=replace(cfg.replay, capacity=300, batch_size=8),
        demonstrations=replace(cfg.demonstrations, transitions_n=40),
        imitation=replace(cfg.imitation, pretrain_updates=5, decay_env_steps=60),
        trainer=replace(
            cfg.trainer,
            **{
                "env_steps": 120,
                "updates_per_step": 0.25,
                "learning_starts": 20,
                "steps_per_batch": 20,
                "collector": "inline",
                "evaluate_every": 60,
                "evaluate_episodes": 2,
                "checkpoint_every": 40,
            }
            | trainer,
        ),
    )


def with_pictures(cfg: TrainCfg) -> TrainCfg:
    """The same run with the encoder that reads pictures."""
    return replace(
        cfg,
        env=replace(cfg.env, observation=replace(cfg.env.observation, image=True)),
        network=replace(cfg.network, encoder="image_cnn"),
        replay=replace(cfg.replay, symmetry_augmentation=False),
    )


def env_spec(cfg: EnvCfg) -> EnvSpec:
    half = cfg.workspace.side_m / 2
    origin = tuple(c - half for c in cfg.workspace.centre_m)
    obs = cfg.observation
    octree = OctreeSpec(origin, cfg.workspace.side_m, obs.depth, obs.leaf_capacity, obs.colour)
    return EnvSpec(octree=octree, stack_n=obs.stack_n, pictures=obs.image)


def make_env(cfg: EnvCfg, seed: int | None = None) -> ToyEnv:
    return ToyEnv(cfg, seed)


class ToyEnv(EnvBase):
    """Success: the gripper closes within 3 cm of the goal, whose surroundings are what the octree shows."""

    def __init__(self, cfg: EnvCfg, seed: int | None = None) -> None:
        super().__init__(batch_size=[], device=None)
        self.cfg, self.spec_ = cfg, env_spec(cfg)
        self.observation_spec = self._make_observation_spec()
        self.action_spec = Bounded(-1, 1, (self.spec_.action_n,))
        self.reward_spec = Unbounded((1,))
        flags = ("done", "terminated", "truncated")
        self.done_spec = Composite({name: Binary(1, (1,), dtype=torch.bool) for name in flags})
        self.rng = torch.Generator().manual_seed(0 if seed is None else seed)

    def _make_observation_spec(self) -> Composite:
        octree, stack = self.spec_.octree, self.spec_.stack_n
        leaves = (stack, octree.leaf_capacity)
        keys = {
            OCTREE: Composite(
                codes=Bounded(-1, 8**octree.depth - 1, leaves, dtype=torch.int16),
                features=Unbounded((*leaves, octree.channels), dtype=torch.float16),
                shape=(stack,),
                data_cls=OctreeFrame,
            ),
            PROPRIO: Unbounded((stack, self.spec_.proprio_n)),
            STAGES: Bounded(0, 1, (self.spec_.stages_n,)),
            OUTCOME: Categorical(9, (1,), dtype=torch.int64),
            SUCCESS: Binary(1, (1,), dtype=torch.bool),
        }
        if self.cfg.observation.image:
            keys[COLOUR_IMAGE] = Bounded(0, 255, (stack, 3, PICTURE_PX, PICTURE_PX), dtype=torch.uint8)
            keys[DEPTH_IMAGE] = Unbounded((stack, 1, PICTURE_PX, PICTURE_PX))
        if self.cfg.observation.expert_labels:
            keys[EXPERT_ACTION] = Bounded(-1, 1, (self.spec_.action_n,))
        return Composite(keys)

    def _set_seed(self, seed: int | None) -> None:
        if seed is not None:
            self.rng.manual_seed(seed)

    def _reset(self, tensordict: TensorDictBase | None = None, **_: object) -> TensorDictBase:
        self.steps_n = 0
        self.stages = torch.zeros(self.spec_.stages_n)
        centre, side = torch.tensor(self.cfg.workspace.centre_m), self.cfg.workspace.side_m
        self.tcp = centre + torch.tensor([0.0, 0.0, 0.3 * side])
        self.goal = centre + (torch.rand(3, generator=self.rng) - 0.5) * torch.tensor([0.6, 0.6, 0.3]) * side
        self.gripper = 1.0
        self.frames = [self._frame()] * self.spec_.stack_n
        self.proprios = [self._proprio()] * self.spec_.stack_n
        self.pictures = [self._picture()] * self.spec_.stack_n
        return self._observation(success=False)

    def _step(self, tensordict: TensorDictBase) -> TensorDictBase:
        action = tensordict[ACTION]
        self.steps_n += 1
        self.tcp = self.tcp + action[:3] * self.cfg.action.translation_step_m
        self.gripper = 1.0 if action[4] > 0 else -1.0
        reached = bool((self.goal - self.tcp).norm() < REACHED_M)
        success = reached and self.gripper < 0
        reward = torch.tensor([self.cfg.reward.step])
        for index, flag in enumerate((reached, success, success, success)):
            if flag and not self.stages[index]:
                self.stages[index] = 1.0
                reward += self.cfg.reward.stage_base**index
        self.frames = [*self.frames[1:], self._frame()]
        self.proprios = [*self.proprios[1:], self._proprio()]
        self.pictures = [*self.pictures[1:], self._picture()]
        out = self._observation(success)
        terminated = torch.tensor([success])
        truncated = torch.tensor([self.steps_n >= self.cfg.episode_steps])
        return out.update(
            {"reward": reward, "terminated": terminated, "truncated": truncated, "done": terminated | truncated}
        )

    def expert(self) -> torch.Tensor:
        """Straight to the goal, then close."""
        offset = self.goal - self.tcp
        action = torch.zeros(5)
        action[:3] = (offset / self.cfg.action.translation_step_m).clamp(-1, 1)
        action[4] = -1.0 if offset.norm() < REACHED_M + self.cfg.action.translation_step_m else 1.0
        return action

    def _observation(self, success: bool) -> TensorDict:
        observation = {
            OCTREE: torch.stack(self.frames),
            PROPRIO: torch.stack(self.proprios),
            STAGES: self.stages.clone(),
            OUTCOME: torch.tensor([0 if success else 1]),
            SUCCESS: torch.tensor([success]),
        }
        if self.cfg.observation.image:
            colours, depths = zip(*self.pictures, strict=True)
            observation |= {COLOUR_IMAGE: torch.stack(colours), DEPTH_IMAGE: torch.stack(depths)}
        if self.cfg.observation.expert_labels:
            observation[EXPERT_ACTION] = self.expert()
        return TensorDict(observation, [])

    def _proprio(self) -> torch.Tensor:
        return torch.tensor([self.gripper, *self.tcp, 1.0, 0.0, 0.0, 0.0, -1.0, 0.0])

    def _picture(self) -> tuple[torch.Tensor, torch.Tensor]:
        """From above: the goal is a bright pixel, as far away as it lies low; what step it is, one beside the edge."""
        colour = torch.zeros(3, PICTURE_PX, PICTURE_PX, dtype=torch.uint8)
        depth = torch.ones(1, PICTURE_PX, PICTURE_PX)
        x, y, _ = (
            (self.goal - torch.tensor(self.spec_.octree.origin_m)) / self.cfg.workspace.side_m * PICTURE_PX
        ).int()
        colour[:, x, y], depth[0, x, y] = 255, 1 - float(self.goal[2])
        colour[0, 0, 0] = self.steps_n
        return colour, depth

    def _frame(self) -> OctreeFrame:
        """The leaf of the goal, and every third leaf of a cube around it, slightly different in every step."""
        octree = self.spec_.octree
        cell = ((self.goal - torch.tensor(octree.origin_m)) / octree.leaf_m).long()
        near = torch.cartesian_prod(*[torch.arange(-1, 2)] * 3)
        keep = torch.rand(27, generator=self.rng) < 0.7
        keep[13] = True
        cells = (cell + near[keep]).clamp(0, octree.cells_n - 1)
        codes = torch.zeros(len(cells), dtype=torch.int64)
        for bit in range(octree.depth):
            for axis in range(3):
                codes |= ((cells[:, axis] >> bit) & 1) << (3 * bit + 2 - axis)
        codes = codes.unique()[: octree.leaf_capacity]
        frame = OctreeFrame.unoccupied(octree)
        frame.codes[: len(codes)] = codes.to(torch.int16)
        frame.features[: len(codes)] = torch.rand(len(codes), octree.channels, generator=self.rng).half()
        return frame
