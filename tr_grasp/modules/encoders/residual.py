"""The Residual O-CNN of the thesis."""

from __future__ import annotations

from collections.abc import Callable

from torch import Tensor, nn

from tr_grasp.errors import ConfigError
from tr_grasp.modules.encoders.grid import GridOCNN, stage_channels
from tr_grasp.modules.encoders.norm import MOMENTUM, Norm
from tr_grasp.octree import NodeSet, Octree, OctreeConv, OctreePool, OctreeSpec

BOTTLENECK = 4


class ResidualBlock(nn.Module):
    """1 x 1 x 1 to a quarter of the channels, 3 x 3 x 3, 1 x 1 x 1 to all of them, plus the input; ReLU in between.

    Args:
        in_channels: If they differ from ``channels``, a 1 x 1 x 1 convolution brings the input to them.
        channels: Channels that come out.
        norm: Makes a normalisation for a number of channels; one follows each of the convolutions.

    Source: ``OctreeResBlock`` of O-CNN (github.com/microsoft/O-CNN).
    """

    def __init__(self, in_channels: int, channels: int, norm: Callable[[int], nn.Module]) -> None:
        super().__init__()
        inner = channels // BOTTLENECK
        self.reduce = nn.Linear(in_channels, inner)
        self.reduce_norm = norm(inner)
        self.conv = OctreeConv(inner, inner)
        self.conv_norm = norm(inner)
        self.expand = nn.Linear(inner, channels, bias=False)
        self.expand_norm = norm(channels)
        self.skip: nn.Module = nn.Identity()
        if in_channels != channels:
            self.skip = nn.Sequential(nn.Linear(in_channels, channels, bias=False), norm(channels))

    def forward(self, x: Tensor, octree: Octree, depth: int) -> Tensor:
        """``(n, in_channels)`` at ``depth`` to ``(n, channels)``, not negative."""
        y = self.reduce_norm(self.reduce(x)).relu()
        y = self.conv_norm(self.conv(y, octree, depth)).relu()
        return (self.expand_norm(self.expand(y)) + self.skip(x)).relu()


class ResidualOCNN(GridOCNN):
    """As ``VanillaOCNN``, with some bottleneck residual blocks in place of each convolution.

    At depth 4 with seven channels it has 189,158 parameters with two blocks and 211,606 with four (1,376 more with
    batch normalisation). The thesis gives no layer widths; these alone lead to its numbers of parameters, and where
    they leave a choice (ReLUs, pooling after the blocks) it is O-CNN's.

    Args:
        spec, node_set, norm, norm_momentum, proprio: As for ``GridOCNN``.
        num_blocks: Residual blocks at each depth.

    Raises:
        ConfigError: If ``num_blocks`` is less than 1.

    Source: the thesis' Residual O-CNN with n = ``num_blocks``.
    """

    def __init__(
        self,
        spec: OctreeSpec,
        node_set: NodeSet = "occupied",
        num_blocks: int = 2,
        norm: Norm = "none",
        norm_momentum: float = MOMENTUM,
        proprio: bool = True,
    ) -> None:
        super().__init__(spec, node_set, norm, norm_momentum, proprio)
        if num_blocks < 1:
            raise ConfigError(f"num_blocks must be at least 1, got {num_blocks}.")
        channels = stage_channels(spec)
        self.depths = tuple(channels)
        self.stages = nn.ModuleList()
        width = spec.channels
        for stage_width in channels.values():
            widths = [width, *[stage_width] * num_blocks]
            self.stages.append(
                nn.ModuleList(ResidualBlock(widths[i], stage_width, self._norm) for i in range(num_blocks))
            )
            width = stage_width
        self.pool = OctreePool("max")
        self._make_heads(width)

    def _trunk(self, x: Tensor, octree: Octree) -> Tensor:
        for depth, blocks in zip(self.depths, self.stages, strict=True):
            for block in blocks:  # type: ignore[attr-defined]
                x = block(x, octree, depth)
            x = self.pool(x, octree, depth)
        return x
