"""The two networks of the thesis (its Table 5.7), and the one that corrects the filter bank."""

from __future__ import annotations

import torch
from torch import Tensor, nn

WINDOW_N = 5
"""Positions that the networks of the thesis read."""
HEADS_N = 2
"""Times for which they predict."""
PERIOD_S = 0.2
"""Time between two positions of the window."""
HIDDEN_N = 100
DROPOUT = 0.1


class MotionMLP(nn.Module):
    """Two hidden layers of 100 over the flattened window."""

    def __init__(self) -> None:
        super().__init__()
        self.head = _head(3 * WINDOW_N)

    def forward(self, windows: Tensor) -> Tensor:
        """Positions (*batch, 2, 3) ahead, relative to the oldest of the window (*batch, 5, 3), as the window is."""
        return self.head(windows.flatten(-2)).unflatten(-1, (HEADS_N, 3))


class MotionLSTM(nn.Module):
    """An LSTM of 100 that reads one flattened window a step, then two hidden layers of 100."""

    def __init__(self) -> None:
        super().__init__()
        self.lstm = nn.LSTM(3 * WINDOW_N, HIDDEN_N, batch_first=True)
        self.head = _head(HIDDEN_N)

    def forward(
        self, windows: Tensor, memory: tuple[Tensor, Tensor] | None = None
    ) -> tuple[Tensor, tuple[Tensor, Tensor]]:
        """Positions (batch, steps, 2, 3) for windows (batch, steps, 5, 3), relative to their oldest; and the memory."""
        features, after = self.lstm(windows.flatten(-2), memory)
        return self.head(features).unflatten(-1, (HEADS_N, 3)), after


class ResidualNet(nn.Module):
    """How to mix three filters, what to add, and how wrong the sum will be.

    Args:
        features_n: Inputs.
        hidden_n: Width of the two hidden layers.
    """

    mean: Tensor
    scale: Tensor

    def __init__(self, features_n: int, hidden_n: int = 96) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(features_n))
        self.register_buffer("scale", torch.ones(features_n))
        last = nn.Linear(hidden_n, 9)
        nn.init.zeros_(last.weight)
        # Untrained, it is nearly the filter bank.
        last.bias = nn.Parameter(torch.tensor([3.0] + [0.0] * 8))
        self.layers = nn.Sequential(
            nn.Linear(features_n, hidden_n), nn.SiLU(), nn.Linear(hidden_n, hidden_n), nn.SiLU(), last
        )

    def forward(self, features: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Shares of the filters (*batch, 3), residual (*batch, 3) in [-1, 1], log of the deviations (*batch, 3)."""
        normal = ((features - self.mean) / self.scale).clamp(-5.0, 5.0)
        gate, residual, spread = self.layers(normal).split(3, -1)
        return gate.softmax(-1), residual.tanh(), spread.clamp(-4.0, 4.0)


def _head(inputs_n: int) -> nn.Sequential:
    return nn.Sequential(
        nn.Linear(inputs_n, HIDDEN_N),
        nn.ReLU(),
        nn.Dropout(DROPOUT),
        nn.Linear(HIDDEN_N, HIDDEN_N),
        nn.ReLU(),
        nn.Linear(HIDDEN_N, 3 * HEADS_N),
    )
