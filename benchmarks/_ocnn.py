"""The peer library ``ocnn``, if it is installed: never a requirement."""

from __future__ import annotations

import sys
import types
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import torch
from torch import Tensor, nn

from tr_grasp.modules.encoders import ENCODERS, OctreeAttention
from tr_grasp.octree import OctreeConv, OctreeDeconv, OctreePool, OctreeSpec


def import_ocnn() -> Any | None:
    """The library, or ``None``."""
    if find_spec("ocnn") is None:
        return None
    if find_spec("torchvision") is not None:
        return import_module("ocnn")
    # It imports torchvision for a model that is not used here. The stand-ins must not outlive the import: others ask
    # whether torchvision is there.
    models = types.ModuleType("torchvision.models")
    models.resnet18 = None  # type: ignore[attr-defined]
    vision = types.ModuleType("torchvision")
    vision.models = models  # type: ignore[attr-defined]
    stand_ins = {"torchvision": vision, "torchvision.models": models}
    sys.modules |= stand_ins
    try:
        return import_module("ocnn")
    finally:
        for name in stand_ins:
            del sys.modules[name]


def build_octree(ocnn: Any, cloud: tuple, spec: OctreeSpec) -> Any:
    """One octree of the cloud's points in the cube."""
    octree = ocnn.octree.Octree(spec.depth, full_depth=2)
    octree.build_octree(_points(ocnn, cloud, spec))
    return octree


def build_octrees(ocnn: Any, clouds: list[tuple], spec: OctreeSpec) -> Any:
    """The octrees of all clouds, merged, built at once: equal to :func:`build_octree` of each and ``merge_octrees``."""
    octree = ocnn.octree.Octree(spec.depth, full_depth=2, batch_size=len(clouds))
    octree.build_octree(ocnn.octree.merge_points([_points(ocnn, cloud, spec) for cloud in clouds]))
    return octree


def _points(ocnn: Any, cloud: tuple, spec: OctreeSpec) -> Any:
    points, normals, colours = (torch.from_numpy(array) for array in cloud)
    unit = (points - torch.tensor(spec.centre_m)) * (2 / spec.side_m)
    inside = (unit.abs() < 1).all(1)
    return ocnn.octree.Points(unit[inside], normals[inside], colours[inside])


def merge(ocnn: Any, octrees: list) -> Any:
    """A batch, with the neighbour tables that a network needs."""
    octree = ocnn.octree.merge_octrees(octrees)
    octree.construct_all_neigh()
    return octree


class VanillaPeer(nn.Module):
    """Vanilla O-CNN from ocnn's layers; ``nempty`` is our node set ``occupied``."""

    def __init__(self, ocnn: Any, nempty: bool) -> None:
        super().__init__()
        self.nempty = nempty
        self.conv4 = ocnn.nn.OctreeConv(7, 32, nempty=nempty)
        self.conv3 = ocnn.nn.OctreeConv(32, 64, nempty=nempty)
        self.pool = ocnn.nn.OctreeMaxPool(nempty)
        self.squeeze, self.head = nn.Linear(64, 16), nn.Linear(1024, 160)
        self.ocnn = ocnn

    def forward(self, octree: Any) -> Tensor:
        """Features ``(B, 160)``."""
        x = octree.get_input_feature("NDF", self.nempty)
        x = self.pool(self.conv4(x, octree, 4).relu(), octree, 4)
        x = self.pool(self.conv3(x, octree, 3).relu(), octree, 3)
        voxels = self.ocnn.nn.octree2voxel(x, octree, 2, self.nempty)
        return self.head(self.squeeze(voxels).relu().flatten(1)).relu()


class EncoderPeer(nn.Module):
    """An encoder of ours with each octree layer replaced by ocnn's of the same widths, without proprioception."""

    def __init__(self, ocnn: Any, name: str, spec: OctreeSpec, nempty: bool) -> None:
        super().__init__()
        self.ocnn, self.nempty = ocnn, nempty
        self.network = ENCODERS[name](spec, node_set="occupied" if nempty else "siblings", proprio=False)
        for parent in list(self.network.modules()):
            for child_name, child in parent.named_children():
                setattr(parent, child_name, self._on_ocnn(child))

    def _on_ocnn(self, layer: nn.Module) -> nn.Module:
        if isinstance(layer, OctreePool):
            return self.ocnn.nn.OctreeMaxPool(self.nempty)
        if isinstance(layer, OctreeAttention):
            return _Attention(layer, self._on_ocnn(layer.node_conv), self.nempty)
        if not isinstance(layer, (OctreeConv, OctreeDeconv)):
            return layer
        _, inputs, outputs = layer.weight.shape
        if isinstance(layer, OctreeDeconv):
            return self.ocnn.nn.OctreeDeconv(inputs, outputs, stride=2, nempty=self.nempty)
        return self.ocnn.nn.OctreeConv(inputs, outputs, stride=layer.stride, nempty=self.nempty)

    def forward(self, octree: Any) -> Tensor:
        """Features ``(B, 160)``."""
        x = self.network._trunk(octree.get_input_feature("NDF", self.nempty), octree)
        voxels = self.ocnn.nn.octree2voxel(x, octree, 2, self.nempty)
        return self.network.octree_head(self.network.squeeze(voxels).relu().flatten(1)).relu()


class _Attention(nn.Module):
    """``OctreeAttention`` on ocnn's octree, which has no maximum over a sample's nodes: PyTorch's."""

    def __init__(self, ours: OctreeAttention, node_conv: nn.Module, nempty: bool) -> None:
        super().__init__()
        self.channel_conv, self.node_conv, self.nempty = ours.channel_conv, node_conv, nempty

    def forward(self, x: Tensor, octree: Any, depth: int) -> Tensor:
        """``(n, channels)`` at ``depth``, weighted."""
        sample = octree.batch_id(depth, self.nempty)
        zeros = x.new_zeros(octree.batch_size, x.shape[1])
        pooled = torch.stack([zeros.index_reduce(0, sample, x, how, include_self=False) for how in ("amax", "mean")])
        weights = torch.sigmoid(self.channel_conv(pooled.flatten(0, 1)[:, None]).view_as(pooled).sum(0))
        x = x * weights.index_select(0, sample)
        summary = torch.stack([x.amax(1), x.mean(1)], dim=1)
        return x * torch.sigmoid(self.node_conv(summary, octree, depth))
