"""What the tests of the losses have in common: an encoder of a plain observation, and transitions of it."""

from __future__ import annotations

import torch
from tensordict import TensorDict
from tensordict.nn import TensorDictModule
from torch import nn

OBS_N, FEATURES_N, ACTION_N, BATCH = 6, 8, 3, 16


def make_encoder() -> TensorDictModule:
    net = nn.Sequential(nn.Linear(OBS_N, FEATURES_N), nn.Tanh())
    return TensorDictModule(net, in_keys=["observation"], out_keys=["z"])


def make_batch() -> TensorDict:
    terminated = torch.arange(BATCH).remainder(4).eq(1)[:, None]
    truncated = torch.arange(BATCH).remainder(4).eq(2)[:, None]
    return TensorDict(
        {
            "observation": torch.randn(BATCH, OBS_N),
            "action": torch.rand(BATCH, ACTION_N) * 2 - 1,
            "next": {
                "observation": torch.randn(BATCH, OBS_N),
                "reward": torch.randn(BATCH, 1),
                "terminated": terminated,
                "truncated": truncated,
                "done": terminated | truncated,
            },
        },
        batch_size=[BATCH],
    )
