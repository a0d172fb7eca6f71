"""Convolution, pooling, upsampling and voxels on the nodes of an ``Octree``.

Features are ``(nodes, channels)``, rows in the order of ``octree.level(depth)``. A convolution equals the dense one on
the full grid with zeros where there is no node, read off at the nodes. Across depths only nodes that have children take
part, as in O-CNN: the others get zeros from below and give nothing to it.

All raise ``ValueError`` if the features do not have a row for each node of their depth, if the octree has no such
depth, or if weight and features differ in dtype or device.
"""

from __future__ import annotations

import torch
from torch import Tensor

from tr_grasp.errors import ConfigError, unknown_name
from tr_grasp.octree.structure import Octree, Pool

POOLS = ("max", "average")


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
        ConfigError: For another number of taps or of channels, or another stride.
    """
    _check_kernel(features, weight, stride, strides=(1, 2))
    _check_rows(features, octree, depth)
    return octree.conv(*_autocast(features, weight), depth, stride)


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
        ConfigError: For another number of taps or of channels.
    """
    _check_kernel(features, weight, stride=2, strides=(2,))
    _check_rows(features, octree, depth)
    return octree.deconv(*_autocast(features, weight), depth)


def octree_pool(features: Tensor, octree: Octree, depth: int, kind: Pool = "max") -> Tensor:
    """Reduce the children of each node: ``(n, channels)`` at ``depth`` to ``(m, channels)`` at ``depth - 1``.

    Children that are not nodes do not count; a node without any gets 0. Equal maxima share the gradient.

    Raises:
        ConfigError: For another kind.
    """
    _check_pool(kind)
    _check_rows(features, octree, depth)
    return octree.pool(features, depth, kind)


def octree_upsample(features: Tensor, octree: Octree, depth: int) -> Tensor:
    """Give each node its parent's features: ``(n, channels)`` at ``depth`` to ``(m, channels)`` at ``depth + 1``."""
    _check_rows(features, octree, depth)
    return octree.upsample(features, depth)


def octree_channel_pool(features: Tensor, kind: Pool = "max") -> Tensor:
    """Largest or mean channel of each node: ``(n, channels)`` to ``(n, 1)``, as spatial attention reads them.

    Raises:
        ConfigError: For another kind.
    """
    _check_pool(kind)
    return features.amax(1, keepdim=True) if kind == "max" else features.mean(1, keepdim=True)


def octree_global_pool(features: Tensor, octree: Octree, depth: int, kind: Pool = "max") -> Tensor:
    """Reduce all nodes of each sample: ``(n, channels)`` at ``depth`` to ``(batch, channels)``.

    A sample without a node gets 0. Equal maxima share the gradient.

    Raises:
        ConfigError: For another kind.
    """
    _check_pool(kind)
    _check_rows(features, octree, depth)
    return octree.level(depth).pool(features, kind)


def octree_to_voxels(features: Tensor, octree: Octree, depth: int) -> Tensor:
    """``(n, channels)`` at ``depth`` as a grid ``(batch, channels, x, y, z)``, zero where there is no node."""
    _check_rows(features, octree, depth)
    return octree.to_voxels(features, depth)


def octree_join_children(features: Tensor, octree: Octree, depth: int) -> Tensor:
    """``(n, channels)`` at ``depth`` to ``(m, 8 * channels)`` at ``depth - 1``: each node's children side by side.

    Children are in the order of their octants, zeros where there is none. With a linear layer this is a convolution
    with kernel and stride 2.
    """
    _check_rows(features, octree, depth)
    return octree.join_children(features, depth)


def _autocast(features: Tensor, weight: Tensor) -> tuple[Tensor, Tensor]:
    # A custom autograd function is invisible to autocast, so cast here what a convolution would cast.
    device = features.device.type
    if not torch.is_autocast_enabled(device):
        if (features.dtype, features.device) != (weight.dtype, weight.device):
            pair = f"{features.dtype} on {features.device} and {weight.dtype} on {weight.device}"
            raise ValueError(f"features and weight must have one dtype and device, got {pair}.")
        return features, weight
    dtype = torch.get_autocast_dtype(device)
    return features.to(dtype), weight.to(dtype)


def _check_kernel(features: Tensor, weight: Tensor, stride: int, strides: tuple[int, ...]) -> None:
    if len(weight) not in (1, 27):
        raise ConfigError(f"weight must have 1 or 27 taps (kernel 1 or 3), got {len(weight)}.")
    if features.ndim != 2 or features.shape[1] != weight.shape[1]:
        raise ConfigError(f"features must be (n, {weight.shape[1]}) for this weight, got {tuple(features.shape)}.")
    if stride not in strides:
        raise ConfigError(f"stride must be 1 or 2, got {stride}.")


def _check_rows(features: Tensor, octree: Octree, depth: int) -> None:
    rows_n = octree.level(depth).nodes_n
    if features.shape[0] != rows_n:
        raise ValueError(f"features must have a row for each of {rows_n} nodes of depth {depth}, got {len(features)}.")


def _check_pool(kind: str) -> None:
    if kind not in POOLS:
        raise ConfigError(unknown_name("pooling", kind, POOLS))
