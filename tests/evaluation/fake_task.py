"""A task with the real one's keys and no physics: obey the expert for long enough and the object is lifted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from tensordict import TensorDict, TensorDictBase
from torchrl.data import Binary, Bounded, Composite, Unbounded
from torchrl.envs import EnvBase

from tr_grasp.configs import EnvCfg
from tr_grasp.envs.sensor import octree_spec
from tr_grasp.errors import MeshError
from tr_grasp.octree import OctreeFrame
from tr_grasp.octree.morton import encode_cells

FAMILIES = ("box", "mug", "plate")


@dataclass(frozen=True)
class FakeModel:
    name: str
    family: str


class FakeTask:
    """What evaluation asks of the simulator beside the observation."""

    def __init__(self, models: tuple[FakeModel, ...]) -> None:
        self.models = list(models)

    def render_image(self, size_px: int = 320) -> np.ndarray:
        ramp = np.linspace(40, 220, size_px, dtype=np.uint8)
        return np.stack(np.broadcast_arrays(ramp[:, None], ramp[None, :], np.uint8(120)), axis=-1).copy()


class FakeEnv(EnvBase):
    """Needs between 3 and 12 obedient steps; one scene in four slips and can never be won."""

    def __init__(self, cfg: EnvCfg) -> None:
        super().__init__(device="cpu", batch_size=[])
        self.cfg = cfg
        self.task = FakeTask(())
        o = cfg.observation
        self.octree_spec = octree_spec(cfg)
        stack = o.stack_n
        self.observation_spec = Composite(
            octree=Composite(
                codes=Unbounded((stack, o.leaf_capacity), dtype=torch.int16),
                features=Unbounded((stack, o.leaf_capacity, self.octree_spec.channels), dtype=torch.float16),
                data_cls=OctreeFrame,
                shape=(stack,),
            ),
            proprio=Unbounded((stack, 10)),
            stages=Unbounded((4,)),
            outcome=Unbounded((1,), dtype=torch.int64),
            success=Binary(1, (1,), dtype=torch.bool),
        )
        if o.expert_labels:
            self.observation_spec["expert_action"] = Bounded(-1, 1, (5,))
        self.action_spec = Bounded(-1, 1, (5,))
        self.reward_spec = Unbounded((1,))
        self.full_done_spec = Composite(
            {key: Binary(1, (1,), dtype=torch.bool) for key in ("done", "terminated", "truncated")}
        )
        self._seed, self._played = 0, 0

    def _set_seed(self, seed: int | None) -> None:
        self._seed, self._played = seed or 0, 0

    def _reset(self, tensordict: TensorDictBase | None = None, **_: Any) -> TensorDictBase:
        self._rng = np.random.default_rng((self._seed, self._played))
        self._played += 1
        low, high = self.cfg.objects.count_range
        kinds = self._rng.choice(FAMILIES, self._rng.integers(low, high + 1))
        self.task.models = [FakeModel(f"{kind}_{i}", str(kind)) for i, kind in enumerate(kinds)]
        self._needed = int(self._rng.integers(3, 13))
        self._slips = bool(self._rng.random() < 0.25)
        self._step_n, self._obeyed = 0, 0
        self._expert = self._rng.uniform(-1, 1, 5).astype(np.float32)
        return self._observation()

    def _step(self, tensordict: TensorDictBase) -> TensorDictBase:
        self._step_n += 1
        self._obeyed += int(np.allclose(tensordict["action"].numpy(), self._expert, atol=0.3))
        state = self._observation()
        terminated = state["success"].clone()
        truncated = torch.tensor([self._step_n >= self.cfg.episode_steps]) & ~terminated
        reward = torch.tensor([400.0 * float(terminated) - 0.005])
        return state.update(
            {"reward": reward, "terminated": terminated, "truncated": truncated, "done": terminated | truncated}
        )

    def _observation(self) -> TensorDict:
        share = min(1.0, self._obeyed / self._needed)
        lifted = share >= 1 and not self._slips
        stages = torch.tensor([share > 0, share > 0.3, share > 0.6, lifted], dtype=torch.float32)
        outcome = 6 if lifted else 3 if share >= 1 else int(stages.sum())
        stack = self.cfg.observation.stack_n
        proprio = torch.zeros(stack, 10)
        proprio[:, 0], proprio[:, 1:4] = 1 - share, torch.tensor([0.5, 0.0, 0.2 - 0.1 * share])
        proprio[:, 4], proprio[:, 8] = 1, 1
        td = TensorDict(
            {
                "octree": torch.stack([self._frame(share)] * stack),
                "proprio": proprio,
                "stages": stages,
                "outcome": torch.tensor([outcome]),
                "success": torch.tensor([lifted]),
            }
        )
        if self.cfg.observation.expert_labels:
            td["expert_action"] = torch.from_numpy(self._expert.copy())
        return td

    def _frame(self, share: float) -> OctreeFrame:
        """A floor with a red block on it that rises when it is held."""
        n = 2**self.cfg.observation.depth
        floor = np.stack(np.meshgrid(np.arange(n), np.arange(n), [0], indexing="ij"), -1).reshape(-1, 3)
        low = 1 + int(share > 0.6)
        block = np.stack(np.meshgrid([n // 2, n // 2 + 1], [n // 2], [low, low + 1], indexing="ij"), -1).reshape(-1, 3)
        cells = np.concatenate([floor, block])
        codes = encode_cells(cells, self.cfg.observation.depth)
        features = np.zeros((len(cells), self.octree_spec.channels), np.float16)
        features[:, 2] = 1
        if self.octree_spec.colour:
            features[: len(floor), 4:] = 0.6
            features[len(floor) :, 4:] = (0.8, 0.2, 0.15)
        order = np.argsort(codes)[: self.octree_spec.leaf_capacity]
        frame = OctreeFrame.unoccupied(self.octree_spec)
        frame.codes[: len(order)] = torch.from_numpy(codes[order].astype(np.int16))
        frame.features[: len(order)] = torch.from_numpy(features[order])
        return frame


def make_fake_env(cfg: EnvCfg) -> EnvBase:
    """The fake for a setting."""
    return FakeEnv(cfg)


def make_broken_env(cfg: EnvCfg) -> EnvBase:
    """A world that cannot be built."""
    raise MeshError("mug: the mesh has no faces.")
