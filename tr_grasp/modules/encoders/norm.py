"""Normalisation of node features, and how its running statistics reach a target network."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Literal

import torch
import torch.nn.functional as F
from tensordict import TensorDictBase
from torch import Tensor, nn

from tr_grasp.errors import ConfigError, unknown_name

Norm = Literal["none", "batch", "group", "layer"]
NORMS = ("none", "batch", "group", "layer")

GROUP_CHANNELS = 8
"""Channels that group normalisation treats together."""

MOMENTUM = 0.01
"""Weight of a new batch in the running statistics (drl_grasping 1.1.0)."""


class NodeBatchNorm(nn.BatchNorm1d):
    """Batch normalisation of ``(n, channels)`` over all nodes of all samples.

    In training mode the batch's own statistics normalise it, so samples influence each other, and enter the running
    ones. A batch of less than two nodes (empty octrees) has no variance: the running statistics normalise it.
    """

    def forward(self, input: Tensor) -> Tensor:
        """Normalised features, same shape."""
        if input.shape[0] > 1:  # len() would fix the batch size of an exported network
            return super().forward(input)
        return F.batch_norm(input, self.running_mean, self.running_var, self.weight, self.bias, eps=self.eps)


def norm_layer(norm: Norm, momentum: float = MOMENTUM) -> Callable[[int], nn.Module]:
    """What makes a normalisation of ``(n, channels)`` for a number of channels.

    Args:
        norm: ``batch``: over all nodes of the batch, with running statistics for evaluation. ``group`` and ``layer``:
            each node on its own, over eight channels or over all; samples stay independent, and training and
            evaluation are alike. ``none``: nothing.
        momentum: Weight of a new batch in the running statistics of ``batch``.

    Raises:
        ConfigError: For another name, or a momentum outside (0, 1].
    """
    if norm not in NORMS:
        raise ConfigError(unknown_name("normalisation", norm, NORMS))
    if not 0 < momentum <= 1:
        raise ConfigError(f"norm_momentum must be in (0, 1], got {momentum}.")
    if norm == "batch":
        return partial(NodeBatchNorm, momentum=momentum)
    return {"none": nn.Identity, "group": _group_norm, "layer": nn.LayerNorm}[norm]


@torch.no_grad()
def copy_statistics(online: TensorDictBase, target: TensorDictBase) -> None:
    """Give a target network the running statistics of the online one.

    TorchRL's target updaters move parameters only and leave every buffer where it was, so a target network with batch
    normalisation would normalise with mean 0 and variance 1 for ever.

    Args:
        online: Parameters and buffers, as ``loss.encoder_network_params``; what needs no gradient is copied.
        target: Its target, as ``loss.target_encoder_network_params``.

    Source: Stable-Baselines3 issue 996, where the same happened.
    """
    for key, value in online.items(include_nested=True, leaves_only=True):
        if not value.requires_grad:
            target.get(key).copy_(value)


def _group_norm(channels: int) -> nn.GroupNorm:
    return nn.GroupNorm(max(channels // GROUP_CHANNELS, 1), channels)
