"""A ManiSkill task of this project as a TorchRL environment."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from tensordict import TensorDict, TensorDictBase
from torchrl.data import Binary, Bounded, Categorical, Composite, Unbounded
from torchrl.envs import EnvBase

from tr_grasp import keys
from tr_grasp.envs.grasp_novel_objects import GraspNovelObjectsEnv
from tr_grasp.envs.sensor import octree_spec
from tr_grasp.octree import OctreeFrame


class TorchRLGraspEnv(EnvBase):
    """One environment with batch size ``[]``; TorchRL resets it, ManiSkill never does so by itself.

    After ``set_seed(s)`` the episodes have seeds derived from ``(s, 0), (s, 1), …``, and the first of them starts in a
    fresh scene, so an episode can be run again by its seed alone.

    Args:
        task: The ManiSkill environment, not wrapped.
        seed: As for ``set_seed``.
    """

    def __init__(self, task: GraspNovelObjectsEnv, seed: int | None = None) -> None:
        super().__init__(device="cpu", batch_size=[])
        self.task = task
        self._episode = 0
        self._base_seed = 0
        self._make_specs()
        self.set_seed(0 if seed is None else seed)

    def _make_specs(self) -> None:
        o = self.task.cfg.observation
        spec = octree_spec(self.task.cfg)
        octree = Composite(
            codes=Unbounded((o.stack_n, spec.leaf_capacity), dtype=spec.code_dtype),
            features=Unbounded((o.stack_n, spec.leaf_capacity, spec.channels), dtype=torch.float16),
            data_cls=OctreeFrame,
            shape=(o.stack_n,),
        )
        observation = {
            keys.OCTREE: octree,
            keys.PROPRIO: Unbounded((o.stack_n, 10), dtype=torch.float32),
            keys.STAGES: Unbounded((4,), dtype=torch.float32),
            keys.OUTCOME: Unbounded((1,), dtype=torch.int64),
            keys.SUCCESS: Binary(1, (1,), dtype=torch.bool),
        }
        if o.image:
            size = self.task.cfg.camera.image_size_px
            observation[keys.COLOUR_IMAGE] = Bounded(0, 255, (o.stack_n, 3, size, size), dtype=torch.uint8)
            observation[keys.DEPTH_IMAGE] = Unbounded((o.stack_n, 1, size, size), dtype=torch.float32)
        if o.expert_labels:
            observation[keys.EXPERT_ACTION] = Bounded(-1.0, 1.0, (5,), dtype=torch.float32)
            observation[keys.EXPERT_TARGET] = Unbounded((6,), dtype=torch.float32)
        self.observation_spec = Composite(observation)
        self.action_spec = Bounded(-1.0, 1.0, (5,), dtype=torch.float32)
        self.reward_spec = Unbounded((1,), dtype=torch.float32)
        flag = Categorical(2, dtype=torch.bool, shape=(1,))
        self.full_done_spec = Composite(done=flag, terminated=flag.clone(), truncated=flag.clone())

    def _set_seed(self, seed: int | None) -> None:
        self._base_seed, self._episode = int(seed or 0), 0

    def _reset(self, tensordict: TensorDictBase | None = None, **kwargs: Any) -> TensorDict:
        fresh = self._episode % self.task.cfg.fresh_scene_every_n == 0
        obs, info = self.task.reset(seed=episode_seed(self._base_seed, self._episode), options={"reconfigure": fresh})
        self._episode += 1
        out = self._observation(obs, info)
        for key in ("done", "terminated", "truncated"):
            out[key] = torch.zeros(1, dtype=torch.bool)
        return out

    def _step(self, tensordict: TensorDictBase) -> TensorDict:
        obs, reward, terminated, truncated, info = self.task.step(tensordict[keys.ACTION])
        out = self._observation(obs, info)
        out["reward"] = reward.reshape(1).float()
        out["terminated"], out["truncated"] = terminated.reshape(1).clone(), truncated.reshape(1).clone()
        out["done"] = out["terminated"] | out["truncated"]
        return out

    def _observation(self, obs: dict[str, Any], info: dict[str, Any]) -> TensorDict:
        octree = OctreeFrame(
            codes=obs[keys.OCTREE]["codes"][0],
            features=obs[keys.OCTREE]["features"][0],
            batch_size=[self.task.cfg.observation.stack_n],
        )
        out = TensorDict(
            {keys.OCTREE: octree, keys.PROPRIO: obs[keys.PROPRIO][0], keys.STAGES: obs[keys.STAGES][0]}, []
        )
        out[keys.OUTCOME] = info["outcome"].reshape(1).clone()
        out[keys.SUCCESS] = info["success"].reshape(1).clone()
        for key in (keys.COLOUR_IMAGE, keys.DEPTH_IMAGE, keys.EXPERT_ACTION, keys.EXPERT_TARGET):
            if key in obs:
                out[key] = obs[key][0]
        return out

    def close(self, **kwargs: Any) -> None:
        """End the simulation."""
        if not self.is_closed:
            self.task.close()
        super().close(**kwargs)


def episode_seed(base_seed: int, episode: int) -> int:
    """The simulator's seed of an episode: a hash, so that neighbouring seeds share nothing."""
    return int(np.random.SeedSequence([base_seed, episode]).generate_state(1)[0] % 2**31)
