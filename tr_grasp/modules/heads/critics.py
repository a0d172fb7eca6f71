"""From features and an action to quantiles of the return, or to one value."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn
from torch.quasirandom import SobolEngine

from tr_grasp.modules.heads.mlp import MakeNet, mlp


class OutputScale(nn.Module):
    """A factor on a critic's output, so that values of hundreds need not grow out of the last layer's weights.

    Args:
        scale: The factor, or where it starts.
        learned: Learn it, as one parameter.
    """

    def __init__(self, scale: float, learned: bool = False) -> None:
        super().__init__()
        self.scale = nn.Parameter(torch.tensor(scale)) if learned else scale

    def forward(self, x: Tensor) -> Tensor:
        """``x`` times the factor."""
        return x * self.scale


class QuantileCritic(nn.Module):
    """Quantiles of the return of an action, as estimated from features and, if given, the stage flags.

    Args:
        features_n: Features read.
        action_n: Components of the action.
        quantiles_n: Quantiles; 1 for a critic of the mean return.
        stages_n: Stage flags read.
        hidden_n: Hidden widths of the MLP.
        layer_norm: Normalise the hidden layers of the MLP.
        make_net: Makes another network than the MLP.
        scale: Applied to the output.
    """

    def __init__(
        self,
        features_n: int,
        action_n: int,
        quantiles_n: int = 25,
        *,
        stages_n: int = 0,
        hidden_n: Sequence[int] = (256, 256),
        layer_norm: bool = False,
        make_net: MakeNet | None = None,
        scale: nn.Module | None = None,
    ) -> None:
        super().__init__()
        make_net = make_net or _make_mlp(hidden_n, layer_norm)
        self.net = make_net(features_n + stages_n + action_n, quantiles_n)
        self.scale = scale or nn.Identity()

    def forward(self, *inputs: Tensor) -> Tensor:
        """Features, stage flags if ``stages_n``, and action, each ``(*batch, n)``, to ``(*batch, quantiles_n)``."""
        return self.scale(self.net(torch.cat(inputs, dim=-1)))


class DuelingQuantileCritic(nn.Module):
    """``Z(s, a) = V(s) + A(s, a) - mean_m A(s, a_m)``, quantile by quantile, with fixed actions ``a_m``.

    Wang et al. split the value of discrete actions like this. Wu et al. (ADC) cut continuous actions into intervals;
    with five components that would be a number of them to the power of five, and the advantage's slope would be zero
    inside each, where an actor looks for one. Here the mean over intervals is a mean over the points of a Sobol
    sequence, the same ones in every critic and its target: ``V`` is the mean over them, and the slope with respect to
    the action stays that of ``A``.

    Args:
        features_n: Features read.
        action_n: Components of the action.
        quantiles_n: Quantiles; 1 for a critic of the mean return.
        stages_n: Stage flags read.
        hidden_n: Hidden widths of the two MLPs.
        layer_norm: Normalise the hidden layers of the MLPs.
        make_net: Makes other networks than the MLPs.
        scale: Applied to the output.
        points_n: Sobol points; a power of two fills the cube evenly.

    Source: Wang et al. 2016, arXiv:1511.06581; Wu et al., advantage decomposition of continuous actions (ADC).
    """

    points: Tensor

    def __init__(
        self,
        features_n: int,
        action_n: int,
        quantiles_n: int = 25,
        *,
        stages_n: int = 0,
        hidden_n: Sequence[int] = (256, 256),
        layer_norm: bool = False,
        make_net: MakeNet | None = None,
        scale: nn.Module | None = None,
        points_n: int = 16,
    ) -> None:
        super().__init__()
        make_net = make_net or _make_mlp(hidden_n, layer_norm)
        self.value = make_net(features_n + stages_n, quantiles_n)
        self.advantage = make_net(features_n + stages_n + action_n, quantiles_n)
        self.scale = scale or nn.Identity()
        self.register_buffer("points", action_points(points_n, action_n))

    def forward(self, *inputs: Tensor) -> Tensor:
        """As of :class:`QuantileCritic`."""
        *state, action = inputs
        state = torch.cat(state, dim=-1)
        advantage = self.advantage(torch.cat([state, action], dim=-1))
        # Apart from the line above, so that no gradient with respect to the action runs through the other points.
        others = self.advantage(state.unsqueeze(-2), self.points)
        return self.scale(self.value(state) + advantage - others.mean(-2))


def action_points(points_n: int, action_n: int) -> Tensor:
    """Sobol points ``(points_n, action_n)`` in [-1, 1]; their mean is 0 if ``points_n`` is a power of two."""
    # A Sobol sequence begins in the cube's corner; half a cell farther it lies about the centre.
    return 2 * SobolEngine(action_n).draw(points_n) - 1 + 1 / points_n


def _make_mlp(hidden_n: Sequence[int], layer_norm: bool) -> MakeNet:
    return lambda in_n, out_n: mlp(in_n, hidden_n, out_n, layer_norm=layer_norm)
