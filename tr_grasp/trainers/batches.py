"""The batch of an update: part demonstrations, part own experience, turned at random."""

from __future__ import annotations

import torch
from tensordict import TensorDict

from tr_grasp.configs import TrainCfg
from tr_grasp.keys import ACTION, EXPERT_ACTION, EXPERT_TARGET, OCTREE, PROPRIO
from tr_grasp.octree import OctreeSpec, random_elements, turn_action, turn_frames, turn_proprio, turn_target
from tr_grasp.trainers.replay import ReplayBuffer

IMITATION_WEIGHT = "imitation_weight"
"""float32 ``(B,)``: 1 where the sample's expert action is to be imitated, else 0."""


class BatchSampler:
    """Draws batches from both buffers with one generator of its own."""

    def __init__(self, cfg: TrainCfg, spec: OctreeSpec, demonstrations: ReplayBuffer, experience: ReplayBuffer) -> None:
        self._cfg = cfg
        self._spec = spec
        self._demonstrations = demonstrations
        self._experience = experience
        self.generator = torch.Generator().manual_seed(cfg.seed)

    def demonstrations(self) -> TensorDict:
        """A batch of demonstrations alone."""
        return self._augment(self._draw(self._demonstrations, self._cfg.replay.batch_size, imitate=True))

    def mixed(self) -> TensorDict:
        """A batch with ``demonstrations.batch_share`` of demonstrations, if there are any."""
        size = self._cfg.replay.batch_size
        share = self._cfg.demonstrations.batch_share if len(self._demonstrations) else 0.0
        from_demonstrations = round(share * size)
        imitate_all = self._cfg.imitation.states == "all"
        parts = []
        if from_demonstrations:
            parts.append(self._draw(self._demonstrations, from_demonstrations, imitate=True))
        if from_demonstrations < size:
            parts.append(self._draw(self._experience, size - from_demonstrations, imitate=imitate_all))
        return self._augment(torch.cat(parts))

    def _draw(self, buffer: ReplayBuffer, n: int, imitate: bool) -> TensorDict:
        batch = buffer.sample(n, self.generator)
        # Own experience is collected without labels unless they are needed.
        batch.set(EXPERT_ACTION, batch.get(EXPERT_ACTION, torch.zeros_like(batch[ACTION])))
        batch.set(EXPERT_TARGET, batch.get(EXPERT_TARGET, batch[ACTION].new_zeros(n, 6)))
        for key in (EXPERT_ACTION, EXPERT_TARGET):
            batch["next"].pop(key, None)
        batch.set(IMITATION_WEIGHT, torch.full((n,), float(imitate)))
        batch["next", "reward"] *= self._cfg.algorithm.reward_scale
        if self._cfg.replay.timeout == "terminal":
            batch["next", "terminated"] |= batch["next", "truncated"]
        return batch

    def _augment(self, batch: TensorDict) -> TensorDict:
        if not self._cfg.replay.symmetry_augmentation:
            return batch
        elements = random_elements(len(batch), self.generator)
        for observation in (batch, batch["next"]):
            observation.set(OCTREE, turn_frames(elements, observation[OCTREE], self._spec))
            observation.set(PROPRIO, turn_proprio(elements, observation[PROPRIO], self._spec))
        for action in (ACTION, EXPERT_ACTION):
            batch.set(action, turn_action(elements, batch[action]))
        batch.set(EXPERT_TARGET, turn_target(elements, batch[EXPERT_TARGET]))
        return batch
