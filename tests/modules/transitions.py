"""Made-up transitions with the keys and shapes of a learner's batch."""

from __future__ import annotations

import torch
from tensordict import TensorDict

from tests.toy_env import PICTURE_PX, env_spec
from tr_grasp.configs import TrainCfg
from tr_grasp.keys import ACTION, COLOUR_IMAGE, DEPTH_IMAGE, EXPERT_ACTION, EXPERT_TARGET, OCTREE, PROPRIO, STAGES
from tr_grasp.octree import OctreeFrame, OctreeSpec
from tr_grasp.trainers.batches import IMITATION_WEIGHT


def transitions(cfg: TrainCfg, batch_n: int, leaves_n: int = 12) -> TensorDict:
    """A quarter each is terminated and truncated; the leaves lie at random."""
    spec = env_spec(cfg.env)
    terminated = torch.arange(batch_n).remainder(4).eq(1)[:, None]
    truncated = torch.arange(batch_n).remainder(4).eq(2)[:, None]
    step = {"terminated": terminated, "truncated": truncated, "done": terminated | truncated}

    def pictures() -> dict:
        shape = (batch_n, spec.stack_n, 3, PICTURE_PX, PICTURE_PX)
        colour = torch.randint(256, shape, dtype=torch.uint8)
        return {COLOUR_IMAGE: colour, DEPTH_IMAGE: torch.rand(shape)[:, :, :1].half()}

    def observation() -> dict:
        return (pictures() if spec.pictures else {}) | {
            OCTREE: frames(spec.octree, (batch_n, spec.stack_n), leaves_n),
            PROPRIO: torch.tensor([1.0, *cfg.env.workspace.centre_m, 1.0, 0.0, 0.0, 0.0, -1.0, 0.0])
            + 0.02 * torch.randn(batch_n, spec.stack_n, spec.proprio_n),
            STAGES: torch.randint(2, (batch_n, spec.stages_n)).float(),
        }

    return TensorDict(
        {
            **observation(),
            ACTION: torch.rand(batch_n, spec.action_n) * 2 - 1,
            EXPERT_ACTION: torch.rand(batch_n, spec.action_n) * 2 - 1,
            EXPERT_TARGET: torch.randn(batch_n, 6),
            IMITATION_WEIGHT: torch.ones(batch_n),
            "next": observation() | step | {"reward": torch.randn(batch_n, 1)},
        },
        batch_size=[batch_n],
    )


def frames(octree: OctreeSpec, batch: tuple[int, ...], leaves_n: int) -> OctreeFrame:
    """Frames of ``leaves_n`` leaves in the middle of the cube, at different places in each."""
    n = torch.Size(batch).numel()
    frame = OctreeFrame.unoccupied(octree)
    codes = frame.codes.repeat(n, 1)
    features = torch.rand(n, octree.leaf_capacity, octree.channels, dtype=torch.float16)
    for row in codes:
        row[:leaves_n] = torch.randperm(8**octree.depth)[:leaves_n].sort().values.to(codes.dtype)
    return OctreeFrame(codes=codes, features=features * (codes >= 0)[..., None], batch_size=[n]).reshape(*batch)
