"""Convolution, pooling and voxels on the nodes of an ``Octree``.

Features are ``(nodes, channels)``, rows in the order of ``octree.level(depth)``. A convolution equals the dense one on
the full grid with zeros where there is no node, read off at the nodes. Across depths only nodes that have children take
part, as in O-CNN: the others get zeros from below and give nothing to it.
"""

from __future__ import annotations

from typing import Literal

import torch
from torch import Tensor

from tr_grasp.errors import ConfigError, unknown_name
from tr_grasp.octree.gather_conv import GatherConv
from tr_grasp.octree.structure import Octree

POOLS = {"max": "max", "average": "mean"}


def octree_conv(features: Tensor, weight: Tensor, octree: Octree, depth: int, stride: int = 1) -> Tensor:
    """Convolve the nodes of ``depth``.

    Args:
        features: ``(n, in)`` at ``depth``.
        weight: ``(taps, in, out)``; taps is 1, or 27 with the offsets in row-major order, which is
            ``Conv3d.weight.permute(2, 3, 4, 1, 0)`` flattened, of a dense convolution with padding 1.
        octree: The octree.
        depth: Depth of ``features``.
        stride: 1, or 2 to arrive at ``depth - 1``. As in O-CNN a strided kernel lies about the first child.

    Returns:
        ``(m, out)`` at ``depth``, or at ``depth - 1`` if the stride is 2.

    Raises:
        ConfigError: For another number of taps, or another stride.
    """
    _check_kernel(weight, stride, strides=(1, 2))
    features, weight = _autocast(features, weight)
    if stride == 2:
        return GatherConv.apply(features, weight, *octree.strided_tables(depth, len(weight)))
    if len(weight) == 1:
        return features @ weight[0]
    return GatherConv.apply(features, weight, octree.level(depth).neighbours, None)


def octree_deconv(features: Tensor, weight: Tensor, octree: Octree, depth: int) -> Tensor:
    """The transpose of a convolution with stride 2: from ``depth`` to ``depth + 1``.

    Args:
        features: ``(n, in)`` at ``depth``.
        weight: ``(taps, in, out)``; taps is 1, or 27 in row-major order, which is
            ``ConvTranspose3d.weight.permute(2, 3, 4, 0, 1)`` flattened (stride 2, padding 1, output padding 1).
        octree: The octree.
        depth: Depth of ``features``.

    Returns:
        ``(m, out)`` at ``depth + 1``.

    Raises:
        ConfigError: For another number of taps.
    """
    _check_kernel(weight, stride=2, strides=(2,))
    features, weight = _autocast(features, weight)
    table, adjoint = octree.strided_tables(depth + 1, len(weight))
    return GatherConv.apply(features, weight, adjoint, table)


def octree_pool(features: Tensor, octree: Octree, depth: int, kind: Literal["max", "average"] = "max") -> Tensor:
    """Reduce the children of each node: ``(n, channels)`` at ``depth`` to ``(m, channels)`` at ``depth - 1``.

    Children that are not nodes do not count; a node without any gets 0. Equal maxima share the gradient.

    Raises:
        ConfigError: For another kind.
    """
    if kind not in POOLS:
        raise ConfigError(unknown_name("pooling", kind, POOLS))
    children_n = octree.children_n(depth - 1)
    pooled = torch.segment_reduce(features, POOLS[kind], lengths=children_n, unsafe=True)
    return pooled.masked_fill((children_n == 0)[:, None], 0)


def octree_to_voxels(features: Tensor, octree: Octree, depth: int) -> Tensor:
    """``(n, channels)`` at ``depth`` as a grid ``(batch, channels, x, y, z)``, zero where there is no node."""
    level = octree.level(depth)
    side = 2**depth
    grid = features.new_zeros(octree.batch_n * level.octants_n, features.shape[1])
    grid = grid.index_copy(0, level.raster, features)
    return grid.view(octree.batch_n, side, side, side, -1).permute(0, 4, 1, 2, 3)


def octree_join_children(features: Tensor, octree: Octree, depth: int) -> Tensor:
    """``(n, channels)`` at ``depth`` to ``(m, 8 * channels)`` at ``depth - 1``: each node's children side by side.

    Children are in the order of their octants, zeros where there is none. With a linear layer this is a convolution
    with kernel and stride 2.
    """
    parents_n = octree.level(depth - 1).nodes_n
    channels = features.shape[1]
    joined = features.new_zeros(parents_n * 8, channels)
    return joined.index_copy(0, octree.child_slots(depth), features).view(parents_n, 8 * channels)


def _autocast(features: Tensor, weight: Tensor) -> tuple[Tensor, Tensor]:
    # A custom autograd function is invisible to autocast, so cast here what a convolution would cast.
    device = features.device.type
    if not torch.is_autocast_enabled(device):
        return features, weight
    dtype = torch.get_autocast_dtype(device)
    return features.to(dtype), weight.to(dtype)


def _check_kernel(weight: Tensor, stride: int, strides: tuple[int, ...]) -> None:
    if len(weight) not in (1, 27):
        raise ConfigError(f"weight must have 1 or 27 taps (kernel 1 or 3), got {len(weight)}.")
    if stride not in strides:
        raise ConfigError(f"stride must be 1 or 2, got {stride}.")
