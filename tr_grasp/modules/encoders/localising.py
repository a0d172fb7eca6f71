"""A small octree encoder that says where things are, relative to the gripper."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from tr_grasp.errors import ConfigError
from tr_grasp.modules.encoders.frames import merge_frames
from tr_grasp.modules.encoders.readout import MaxReadout, SpatialReadout
from tr_grasp.modules.encoders.tool_frame import TOOL_FEATURES_N, ToolPose, tool_pose
from tr_grasp.octree import Backend, Octree, OctreeConv, OctreeFrame, OctreeSpec, octree_join_children

OFFSET_SCALE = 2.0
"""Offsets from the tcp are numbers this much larger than positions in the cube."""


class LocalisingOCNN(nn.Module):
    """Attention over blocks of eight leaves that reads out positions, orientations and values.

    A leaf is known to a fraction of its size: its mean point lies at the stored distance from the cell's centre along
    the mean normal. That point is given in the cube, relative to the tcp, and along the tool's axes. Eight leaves make
    a block, described by a linear layer, convolutions over neighbouring blocks, and an MLP that also reads the mean
    position; ``SpatialReadout`` makes one vector of all blocks. No grid is filled, and nothing is flattened that would
    tie what is learned at one place to that place.

    Each part can be left out, to see what it is worth. Attention reads the positions relative to the tcp and along
    the tool's axes, those in the cube if there are no others; the moments are those along the tool's axes, or along
    the base's x and y.

    Args:
        spec: The frames' octree.
        features_n: Features of a frame.
        conv_layers_n: Residual convolutions, through which a block sees its neighbours. One costs nearly as much as
            everything else.
        heads_n: Attention heads.
        absolute_coordinates: Give positions in the cube.
        tcp_coordinates: Give positions relative to the tcp, along the base's axes, and the distance from it.
        tool_coordinates: Give positions relative to the tcp along the tool's x and y axes.
        attention: Read out by attention; otherwise only the largest of every channel.
        central_moments: Attention reads second moments about the attended mean instead of about the tcp.

    Raises:
        ConfigError: Without any coordinates.
    """

    block_channels = 32
    hidden_n = 48
    values_n = 16
    head_hidden_n = 192
    backend: Backend = "sparse"

    def __init__(
        self,
        spec: OctreeSpec,
        features_n: int = 128,
        conv_layers_n: int = 1,
        heads_n: int = 16,
        absolute_coordinates: bool = True,
        tcp_coordinates: bool = True,
        tool_coordinates: bool = True,
        attention: bool = True,
        central_moments: bool = True,
    ) -> None:
        super().__init__()
        self.spec = spec
        self.features_n = features_n
        self._absolute, self._tcp, self._tool = absolute_coordinates, tcp_coordinates, tool_coordinates
        absolute_n, relative_n = 3 * absolute_coordinates, 3 * tcp_coordinates + 2 * tool_coordinates
        positions_n = absolute_n + relative_n
        if not positions_n:
            raise ConfigError(
                "localising_ocnn needs one of absolute_coordinates, tcp_coordinates and tool_coordinates, or a block "
                "does not know where it is."
            )
        self._read_n = relative_n or absolute_n

        self.join = nn.Linear(8 * (spec.channels + 1 + positions_n), self.block_channels)
        self.convs = nn.ModuleList(
            OctreeConv(self.block_channels, self.block_channels, bias=True) for _ in range(conv_layers_n)
        )
        self.describe = nn.Sequential(
            nn.Linear(self.block_channels + positions_n + tcp_coordinates + 1, self.hidden_n),
            nn.ReLU(),
            nn.Linear(self.hidden_n, self.hidden_n),
            nn.ReLU(),
        )
        self.readout = MaxReadout(self.hidden_n)
        if attention:
            plane = (self._read_n - 2, self._read_n - 1) if tool_coordinates else (0, 1)
            self.readout = SpatialReadout(self.hidden_n, heads_n, self.values_n, self._read_n, plane, central_moments)
        self.head = nn.Sequential(
            nn.Linear(self.readout.features_n + TOOL_FEATURES_N, self.head_hidden_n),
            nn.ReLU(),
            nn.Linear(self.head_hidden_n, features_n),
            nn.LayerNorm(features_n),
            nn.Tanh(),
        )

    def forward(self, frames: OctreeFrame, proprio: Tensor) -> Tensor:
        """Features ``(B, features_n)`` of frames with batch size ``(B,)`` and proprioception ``(B, 10)``."""
        octree = merge_frames(frames, self.spec, backend=self.backend)
        tool = tool_pose(proprio, self.spec)
        level = octree.level(self.spec.depth - 1)
        leaves, positions = self._leaves(octree, tool)

        children = octree_join_children(leaves, octree, self.spec.depth)
        blocks = self.join(children).relu()
        for conv in self.convs:
            blocks = blocks + conv(blocks, octree, level.depth).relu()

        counts = octree.children_n(level.depth)[:, None]
        means = children.unflatten(1, (8, leaves.shape[1]))[:, :, -positions.shape[1] :].sum(1) / counts
        read = means[:, -self._read_n :]
        distances = [read[:, :3].norm(dim=1, keepdim=True)] if self._tcp else []
        blocks = self.describe(torch.cat([blocks, means, *distances, counts / 8], dim=1))
        return self.head(torch.cat([self.readout(blocks, read, level), tool.features], dim=1))

    def _leaves(self, octree: Octree, tool: ToolPose) -> tuple[Tensor, Tensor]:
        """``(leaves, channels + 1 + positions)``: stored features, 1, positions; and the positions alone."""
        features = octree.leaf_features()
        positions = self._positions(octree, tool)
        return torch.cat([features, torch.ones_like(features[:, :1]), positions], dim=1), positions

    def _positions(self, octree: Octree, tool: ToolPose) -> Tensor:
        """``(leaves, 8)``, or less: in the cube (3), from the tcp (3), along the tool's axes (2)."""
        samples, points = octree.leaves.samples, octree.leaf_points()
        offsets = (points - tool.position.index_select(0, samples)) * OFFSET_SCALE
        positions = [points] if self._absolute else []
        if self._tcp:
            positions.append(offsets)
        if self._tool:
            axes = tool.axes.index_select(0, samples)
            positions.append(torch.bmm(axes, offsets[:, :, None])[:, :, 0])
        return torch.cat(positions, dim=1)
