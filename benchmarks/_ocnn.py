"""The peer library ``ocnn``, if it is installed: never a requirement."""

from __future__ import annotations

import sys
import types
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import torch
from torch import Tensor, nn

from tr_grasp.octree import OctreeSpec


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
    points, normals, colours = (torch.from_numpy(array) for array in cloud)
    unit = (points - torch.tensor(spec.centre_m)) * (2 / spec.side_m)
    inside = (unit.abs() < 1).all(1)
    octree = ocnn.octree.Octree(spec.depth, full_depth=2)
    octree.build_octree(ocnn.octree.Points(unit[inside], normals[inside], colours[inside]))
    return octree


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
