"""Linear layers and multi-layer perceptrons that read several inputs side by side."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from torch import Tensor, nn
from torch.nn import functional as F

MakeNet = Callable[[int, int], nn.Module]
"""Makes a network of so many inputs and outputs; it is called with one or more tensors whose widths add up."""


class ConcatLinear(nn.Linear):
    """``nn.Linear`` of the concatenation of its inputs.

    Inputs need only broadcast against each other: each is multiplied alone, so what is the same for many actions is
    multiplied once.
    """

    def forward(self, *inputs: Tensor) -> Tensor:
        """Inputs ``(*batch, n_i)`` with ``sum(n_i) = in_features`` to ``(*batch, out_features)``."""
        if len(inputs) == 1:
            return super().forward(*inputs)
        columns = self.weight.split([x.shape[-1] for x in inputs], dim=1)
        first, *others = (F.linear(x, w) for x, w in zip(inputs, columns, strict=True))
        return sum(others, first if self.bias is None else first + self.bias)


class MLP(nn.Sequential):
    """A sequence that begins with a :class:`ConcatLinear` and is called with its inputs."""

    def forward(self, *inputs: Tensor) -> Tensor:
        """Inputs ``(*batch, n_i)`` to ``(*batch, out_n)``."""
        first, *others = self
        x = first(*inputs)
        for layer in others:
            x = layer(x)
        return x


def mlp(in_n: int, hidden_n: Sequence[int], out_n: int, *, layer_norm: bool = False) -> MLP:
    """Linear layers with ReLU between them, and LayerNorm before each ReLU if wanted."""
    layers: list[nn.Module] = []
    for width in hidden_n:
        layers += [ConcatLinear(in_n, width), *([nn.LayerNorm(width)] if layer_norm else []), nn.ReLU()]
        in_n = width
    return MLP(*layers, ConcatLinear(in_n, out_n))
