"""What sits on the encoder's features: a Gaussian actor and a quantile critic."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn

LOG_STD_RANGE = (-20.0, 2.0)
"""Clamp of the log standard deviation before the tanh, as in the authors' code and in SB3."""


def mlp(in_n: int, hidden_n: Sequence[int], out_n: int, *, layer_norm: bool = False) -> nn.Sequential:
    """Linear layers with ReLU between them, and LayerNorm before each ReLU if wanted."""
    layers: list[nn.Module] = []
    for width in hidden_n:
        layers += [nn.Linear(in_n, width), *([nn.LayerNorm(width)] if layer_norm else []), nn.ReLU()]
        in_n = width
    return nn.Sequential(*layers, nn.Linear(in_n, out_n))


class GaussianActor(nn.Module):
    """Mean and standard deviation of the action before it is squashed by tanh.

    Args:
        features_n: Features read.
        action_n: Components of the action.
        hidden_n: Hidden widths.
        log_std_init: Log standard deviation that the fresh network gives on average.
    """

    def __init__(
        self,
        features_n: int,
        action_n: int,
        hidden_n: Sequence[int] = (256, 256),
        log_std_init: float = 0.0,
    ) -> None:
        super().__init__()
        self.net = mlp(features_n, hidden_n, 2 * action_n)
        with torch.no_grad():
            self.net[-1].bias[action_n:] += log_std_init

    def forward(self, features: Tensor) -> tuple[Tensor, Tensor]:
        """``(*batch, features_n)`` to mean and standard deviation, each ``(*batch, action_n)``."""
        mean, log_std = self.net(features).chunk(2, dim=-1)
        return mean, log_std.clamp(*LOG_STD_RANGE).exp()


class QuantileCritic(nn.Module):
    """Quantiles of the return of an action, as estimated from features and, if given, the stage flags."""

    def __init__(
        self,
        features_n: int,
        action_n: int,
        quantiles_n: int = 25,
        *,
        stages_n: int = 0,
        hidden_n: Sequence[int] = (256, 256),
        layer_norm: bool = False,
    ) -> None:
        super().__init__()
        self.net = mlp(features_n + stages_n + action_n, hidden_n, quantiles_n, layer_norm=layer_norm)

    def forward(self, *inputs: Tensor) -> Tensor:
        """Features, stage flags if ``stages_n``, and action, each ``(*batch, n)``, to ``(*batch, quantiles_n)``."""
        return self.net(torch.cat(inputs, dim=-1))
