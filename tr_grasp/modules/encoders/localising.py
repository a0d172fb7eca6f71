"""A small octree encoder that says where things are, relative to the gripper."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from tr_grasp.modules.encoders.readout import OFFSETS_N, SpatialReadout
from tr_grasp.modules.encoders.tool_frame import TOOL_FEATURES_N, ToolPose, tool_pose
from tr_grasp.octree import Octree, OctreeConv, OctreeFrame, OctreeSpec, octree_join_children

OFFSET_SCALE = 2.0
"""Offsets from the tcp are numbers this much larger than positions in the cube."""


class LocalisingOCNN(nn.Module):
    """Attention over blocks of eight leaves that reads out positions, orientations and values.

    A leaf is known to a fraction of its size: its mean point lies at the stored distance from the cell's centre along
    the mean normal. That point is given in the cube, relative to the tcp, and along the tool's axes. Eight leaves make
    a block, described by a linear layer, convolutions over neighbouring blocks, and an MLP that also reads the mean
    position; ``SpatialReadout`` makes one vector of all blocks. No grid is filled, and nothing is flattened that would
    tie what is learned at one place to that place.

    Args:
        spec: The frames' octree.
        features_n: Features of a frame.
        conv_layers_n: Residual convolutions, through which a block sees its neighbours. One costs nearly as much as
            everything else.
        heads_n: Attention heads.
    """

    block_channels = 32
    hidden_n = 48
    values_n = 16
    head_hidden_n = 192

    def __init__(self, spec: OctreeSpec, features_n: int = 128, conv_layers_n: int = 1, heads_n: int = 16) -> None:
        super().__init__()
        self.spec = spec
        self.features_n = features_n
        positions_n = 3 + OFFSETS_N
        self.join = nn.Linear(8 * (spec.channels + 1 + positions_n), self.block_channels)
        self.convs = nn.ModuleList(
            OctreeConv(self.block_channels, self.block_channels, bias=True) for _ in range(conv_layers_n)
        )
        self.describe = nn.Sequential(
            nn.Linear(self.block_channels + positions_n + 2, self.hidden_n),
            nn.ReLU(),
            nn.Linear(self.hidden_n, self.hidden_n),
            nn.ReLU(),
        )
        self.readout = SpatialReadout(self.hidden_n, heads_n, self.values_n)
        self.head = nn.Sequential(
            nn.Linear(self.readout.features_n + TOOL_FEATURES_N, self.head_hidden_n),
            nn.ReLU(),
            nn.Linear(self.head_hidden_n, features_n),
            nn.LayerNorm(features_n),
            nn.Tanh(),
        )

    def forward(self, frames: OctreeFrame, proprio: Tensor) -> Tensor:
        """Features ``(B, features_n)`` of frames with batch size ``(B,)`` and proprioception ``(B, 10)``."""
        octree = Octree(frames, self.spec.depth)
        tool = tool_pose(proprio, self.spec)
        level = octree.level(self.spec.depth - 1)
        leaves, positions = self._leaves(octree, tool)

        children = octree_join_children(leaves, octree, self.spec.depth)
        blocks = self.join(children).relu()
        for conv in self.convs:
            blocks = blocks + conv(blocks, octree, level.depth).relu()

        counts = octree.children_n(level.depth)[:, None]
        means = children.unflatten(1, (8, leaves.shape[1]))[:, :, -positions.shape[1] :].sum(1) / counts
        offsets = means[:, 3:]
        distances = offsets[:, :3].norm(dim=1, keepdim=True)
        blocks = self.describe(torch.cat([blocks, means, distances, counts / 8], dim=1))
        return self.head(torch.cat([self.readout(blocks, offsets, level), tool.features], dim=1))

    def _leaves(self, octree: Octree, tool: ToolPose) -> tuple[Tensor, Tensor]:
        """``(leaves, channels + 9)``: stored features, 1, positions; and the last eight, the positions, alone."""
        samples = octree.leaves.samples
        features, points = octree.leaf_features(), octree.leaf_points()
        offsets = (points - tool.position.index_select(0, samples)) * OFFSET_SCALE
        along_axes = torch.bmm(tool.axes.index_select(0, samples), offsets[:, :, None])[:, :, 0]
        positions = torch.cat([points, offsets, along_axes], dim=1)
        return torch.cat([features, torch.ones_like(features[:, :1]), positions], dim=1), positions
