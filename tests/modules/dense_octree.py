"""Octree operators on full grids with masks: slow, and independent of the sparse ones."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

from tr_grasp.octree import Octree, octree_to_voxels


def grid(features: Tensor, octree: Octree, depth: int) -> Tensor:
    """Node features as ``(batch, channels, x, y, z)``."""
    return octree_to_voxels(features, octree, depth)


def mask(octree: Octree, depth: int) -> Tensor:
    """1 where there is a node, ``(batch, 1, x, y, z)``."""
    nodes_n = octree.level(depth).nodes_n
    return grid(torch.ones(nodes_n, 1, dtype=torch.float64), octree, depth)


def conv(x: Tensor, weight: Tensor, to_mask: Tensor, stride: int = 1) -> Tensor:
    """Masked ``conv3d`` by a weight ``(27, in, out)``."""
    kernel = weight.view(3, 3, 3, *weight.shape[1:]).permute(4, 3, 0, 1, 2)
    return F.conv3d(x, kernel, stride=stride, padding=1) * to_mask


def deconv(x: Tensor, weight: Tensor, to_mask: Tensor) -> Tensor:
    """Masked ``conv_transpose3d`` by a weight ``(27, in, out)``."""
    kernel = weight.view(3, 3, 3, *weight.shape[1:]).permute(3, 4, 0, 1, 2)
    return F.conv_transpose3d(x, kernel, stride=2, padding=1, output_padding=1) * to_mask


def pointwise(x: Tensor, layer: torch.nn.Linear, to_mask: Tensor) -> Tensor:
    """A linear layer at every node."""
    return layer(x.movedim(1, -1)).movedim(-1, 1) * to_mask
