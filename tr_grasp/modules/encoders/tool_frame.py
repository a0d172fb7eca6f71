"""The gripper in the octree's cube."""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor

from tr_grasp.octree import OctreeSpec

TOOL_FEATURES_N = 8

_PREFERRED_HEADING = (math.sqrt(0.5), math.sqrt(0.5), 0.0)
"""Diagonal, so that tools along the axes of the base are far from the border between the two descriptions."""


class ToolPose(NamedTuple):
    """Pose of the tool in units of the cube: its centre is the origin, half its edge is 1."""

    position: Tensor
    """``(B, 3)``."""

    axes: Tensor
    """``(B, 2, 3)``: the tool's x axis, and its y axis, along which the fingers close."""

    features: Tensor
    """``(B, 8)``: gripper, position, cosine and sine of twice the yaw, and the axes' vertical parts."""


def tool_pose(proprio: Tensor, spec: OctreeSpec) -> ToolPose:
    """Read proprioception ``(B, 10)``: gripper, tcp position [m], R_base_tcp[:, 0], R_base_tcp[:, 1].

    A parallel gripper turned by half a turn about its approach axis is the same gripper, and both give the same result:
    the axes are returned as of the description whose y axis points to the preferred side.
    """
    gripper, position, columns = proprio.split([1, 3, 6], dim=1)
    position = (position - position.new_tensor(spec.centre_m)) * (2 / spec.side_m)
    axes = columns.view(-1, 2, 3)
    other_side = axes[:, 1] @ axes.new_tensor(_PREFERRED_HEADING) < 0
    axes = torch.where(other_side[:, None, None], -axes, axes)
    x, y = axes[:, 1, :1], axes[:, 1, 1:2]
    features = torch.cat([gripper, position, x * x - y * y, 2 * x * y, axes[:, :, 2]], dim=1)
    return ToolPose(position, axes, features)
