"""From features to an action before it is squashed by tanh."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from tr_grasp.modules.heads.mlp import MakeNet, mlp

LOG_STD_RANGE = (-20.0, 2.0)
"""Clamp of the log standard deviation before the tanh, as in the authors' code and in SB3."""


class GaussianActor(nn.Module):
    """Mean and standard deviation of the action before it is squashed by tanh.

    Args:
        features_n: Features read.
        action_n: Components of the action.
        hidden_n: Hidden widths of the MLP.
        log_std_init: Log standard deviation that the fresh network gives on average.
        make_net: Makes another network than the MLP; its last linear layer must be its output.
    """

    def __init__(
        self,
        features_n: int,
        action_n: int,
        hidden_n: Sequence[int] = (256, 256),
        log_std_init: float = 0.0,
        *,
        make_net: MakeNet | None = None,
    ) -> None:
        super().__init__()
        self.net = _make(make_net, hidden_n, features_n, 2 * action_n)
        *_, output = (layer for layer in self.net.modules() if isinstance(layer, nn.Linear))
        with torch.no_grad():
            output.bias[action_n:] += log_std_init

    def forward(self, features: Tensor) -> tuple[Tensor, Tensor]:
        """``(*batch, features_n)`` to mean and standard deviation, each ``(*batch, action_n)``."""
        mean, log_std = self.net(features).chunk(2, dim=-1)
        return mean, log_std.clamp(*LOG_STD_RANGE).exp()

    def mean(self, features: Tensor) -> Tensor:
        """The mean alone."""
        return self(features)[0]


class DeterministicActor(nn.Module):
    """The action before it is squashed by tanh; arguments as of :class:`GaussianActor`."""

    def __init__(
        self,
        features_n: int,
        action_n: int,
        hidden_n: Sequence[int] = (256, 256),
        *,
        make_net: MakeNet | None = None,
    ) -> None:
        super().__init__()
        self.net = _make(make_net, hidden_n, features_n, action_n)

    def forward(self, features: Tensor) -> Tensor:
        """``(*batch, features_n)`` to ``(*batch, action_n)``."""
        return self.net(features)

    mean = forward


def _make(make_net: MakeNet | None, hidden_n: Sequence[int], in_n: int, out_n: int) -> nn.Module:
    return mlp(in_n, hidden_n, out_n) if make_net is None else make_net(in_n, out_n)
