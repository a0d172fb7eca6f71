"""A residual network whose blocks read the input again."""

from __future__ import annotations

from torch import Tensor, nn

from tr_grasp.modules.heads.mlp import ConcatLinear
from tr_grasp.modules.heads.spectral_norm import SpectralNorm


class DenseResidualMLP(nn.Module):
    """``h_0 = ReLU(W_in x)``, ``h_k = h_{k-1} + B_k ReLU(A_k [LN(h_{k-1}); x])``, ``y = W_out LN(h_K)``.

    Residual as in Bjorck et al., who normalise what enters a block and find that deep critics without a bound on their
    slope destabilise the actor; dense as in D2RL, where each layer reads the input again. The thesis names both and
    gives no sizes; 256 and two blocks are about as large as its vanilla heads.

    Args:
        in_n: Widths of all inputs together.
        out_n: Outputs.
        width: Channels of ``h`` and of the hidden layer in a block.
        blocks_n: Blocks, ``K``.
        spectral_norm: Divide ``A_k`` and ``B_k`` by their largest singular values. ``W_in``, ``W_out`` and the layer
            norms stay as they are, so that outputs of any size can be reached.

    Source: Bjorck, Gomes, Weinberger 2021, arXiv:2106.01151; Sinha et al. 2020 (D2RL), arXiv:2010.09163.
    """

    def __init__(
        self, in_n: int, out_n: int, width: int = 256, blocks_n: int = 2, *, spectral_norm: bool = False
    ) -> None:
        super().__init__()
        self.input = ConcatLinear(in_n, width)
        self.blocks = nn.ModuleList(_DenseBlock(in_n, width, spectral_norm) for _ in range(blocks_n))
        self.norm = nn.LayerNorm(width)
        self.output = nn.Linear(width, out_n)

    def forward(self, *inputs: Tensor) -> Tensor:
        """Inputs ``(*batch, n_i)``, which need only broadcast, with ``sum(n_i) = in_n`` to ``(*batch, out_n)``."""
        h = self.input(*inputs).relu()
        for block in self.blocks:
            h = h + block(h, *inputs)
        return self.output(self.norm(h))


class _DenseBlock(nn.Module):
    """``B ReLU(A [LN(h); x])``."""

    def __init__(self, in_n: int, width: int, spectral_norm: bool) -> None:
        super().__init__()
        self.norm = nn.LayerNorm(width)
        a, b = ConcatLinear(width + in_n, width), nn.Linear(width, width)
        self.a, self.b = (SpectralNorm(a), SpectralNorm(b)) if spectral_norm else (a, b)

    def forward(self, h: Tensor, *inputs: Tensor) -> Tensor:
        return self.b(self.a(self.norm(h), *inputs).relu())
