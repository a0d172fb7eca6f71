"""The octree operators as modules; all are called with features, octree and the depth of the features."""

from __future__ import annotations

import math
from typing import Literal

import torch
from torch import Tensor, nn

from tr_grasp.errors import ConfigError
from tr_grasp.octree.operators import octree_conv, octree_deconv, octree_pool
from tr_grasp.octree.structure import Octree


class _Kernel(nn.Module):
    """Weight ``(kernel**3, in, out)`` and an optional bias, initialised as in ``torch.nn.Conv3d``."""

    def __init__(self, in_channels: int, out_channels: int, kernel: int, bias: bool) -> None:
        super().__init__()
        if kernel not in (1, 3):
            raise ConfigError(f"kernel must be 1 or 3, got {kernel}.")
        bound = 1 / math.sqrt(kernel**3 * in_channels)
        self.weight = nn.Parameter(torch.empty(kernel**3, in_channels, out_channels).uniform_(-bound, bound))
        self.bias = nn.Parameter(torch.empty(out_channels).uniform_(-bound, bound)) if bias else None

    def _add_bias(self, features: Tensor) -> Tensor:
        return features if self.bias is None else features + self.bias

    def extra_repr(self) -> str:
        taps, in_channels, out_channels = self.weight.shape
        return f"{in_channels}, {out_channels}, taps={taps}, bias={self.bias is not None}"


class OctreeConv(_Kernel):
    """``octree_conv`` with its weight. Without bias unless asked for, as in O-CNN."""

    def __init__(
        self, in_channels: int, out_channels: int, kernel: int = 3, stride: int = 1, bias: bool = False
    ) -> None:
        super().__init__(in_channels, out_channels, kernel, bias)
        self.stride = stride

    def forward(self, features: Tensor, octree: Octree, depth: int) -> Tensor:
        """``(n, in)`` at ``depth`` to ``(m, out)`` at ``depth``, or at ``depth - 1`` if the stride is 2."""
        return self._add_bias(octree_conv(features, self.weight, octree, depth, self.stride))


class OctreeDeconv(_Kernel):
    """``octree_deconv`` with its weight. Without bias unless asked for, as in O-CNN."""

    def __init__(self, in_channels: int, out_channels: int, kernel: int = 3, bias: bool = False) -> None:
        super().__init__(in_channels, out_channels, kernel, bias)

    def forward(self, features: Tensor, octree: Octree, depth: int) -> Tensor:
        """``(n, in)`` at ``depth`` to ``(m, out)`` at ``depth + 1``."""
        return self._add_bias(octree_deconv(features, self.weight, octree, depth))


class OctreePool(nn.Module):
    """``octree_pool`` of one kind."""

    def __init__(self, kind: Literal["max", "average"] = "max") -> None:
        super().__init__()
        self.kind: Literal["max", "average"] = kind

    def forward(self, features: Tensor, octree: Octree, depth: int) -> Tensor:
        """``(n, channels)`` at ``depth`` to ``(m, channels)`` at ``depth - 1``."""
        return octree_pool(features, octree, depth, self.kind)
