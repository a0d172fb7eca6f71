"""The peer library as an oracle, where it is installed; every law here is also tested against dense grids."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
import torch
from torch import Tensor

from benchmarks._ocnn import build_octree, build_octrees, import_ocnn, merge
from tests.octree.clouds import SPEC, random_cloud
from tr_grasp.octree import (
    Octree,
    OctreeSpec,
    octree_conv,
    octree_deconv,
    octree_global_pool,
    octree_pool,
    octree_to_voxels,
    octree_upsample,
    octrees_from_clouds,
)

ocnn = import_ocnn()
pytestmark = pytest.mark.skipif(ocnn is None, reason="ocnn is not installed")

NODE_SETS = ["occupied", "siblings"]
CLOUDS = [[array.astype("float32") for array in random_cloud(seed, spread=0.7)] for seed in range(3)]
IN, OUT = 3, 4


def both(node_set: str, spec: OctreeSpec = SPEC, backend: str = "sparse") -> tuple[Octree, object]:
    frames = octrees_from_clouds(CLOUDS, spec)
    theirs = merge(ocnn, [build_octree(ocnn, cloud, spec) for cloud in CLOUDS])
    return Octree(frames, spec.depth, node_set, backend), theirs


@pytest.mark.parametrize("depth", [3, 4, 5, 6])
@pytest.mark.parametrize("node_set", NODE_SETS)
def test_leaves_their_order_and_their_features_agree(node_set: str, depth: int) -> None:
    ours, theirs = both(node_set, OctreeSpec(SPEC.origin_m, SPEC.side_m, depth))
    nempty = node_set == "occupied"
    x, y, z, sample = theirs.xyzb(depth, nempty)
    level = ours.level(depth)
    assert torch.equal(torch.stack([x, y, z], dim=1), level.cells)
    assert torch.equal(sample, level.samples)
    features = theirs.get_input_feature("NDF", nempty)
    features[:, 3] *= 2 / math.sqrt(3)  # their distance is in half leaf edges
    torch.testing.assert_close(ours.node_features(), features, atol=2e-3, rtol=0)


def test_the_two_ways_of_building_a_batch_that_benchmarks_time_agree() -> None:
    one_by_one = ocnn.octree.merge_octrees([build_octree(ocnn, cloud, SPEC) for cloud in CLOUDS])
    at_once = build_octrees(ocnn, CLOUDS, SPEC)
    assert all(map(torch.equal, one_by_one.xyzb(4, True), at_once.xyzb(4, True)))
    torch.testing.assert_close(one_by_one.get_input_feature("NDF", True), at_once.get_input_feature("NDF", True))


def our_operators(octree: Octree) -> dict[str, tuple[int, Callable[..., Tensor]]]:
    """Depth of the input, and the operator of features and a weight ``(27, in, out)``."""
    return {
        "conv": (4, lambda x, w: octree_conv(x, w, octree, 4)),
        "strided conv": (4, lambda x, w: octree_conv(x, w, octree, 4, stride=2)),
        "deconv": (3, lambda x, w: octree_deconv(x, w, octree, 3)),
        "max pool": (4, lambda x, _: octree_pool(x, octree, 4)),
        "average pool": (4, lambda x, _: octree_pool(x, octree, 4, "average")),
        "upsample": (3, lambda x, _: octree_upsample(x, octree, 3)),
        "global average": (4, lambda x, _: octree_global_pool(x, octree, 4, "average")),
        "voxels": (3, lambda x, _: octree_to_voxels(x, octree, 3).permute(0, 2, 3, 4, 1)),
    }


def their_operators(octree: object, nempty: bool) -> dict[str, Callable[..., Tensor]]:
    nn = ocnn.nn

    def layer(made: torch.nn.Module, weight: Tensor, x: Tensor, depth: int) -> Tensor:
        del made.weights  # a parameter; the weight under test takes its place
        made.weights = weight
        return made(x, octree, depth)

    return {
        "conv": lambda x, w: layer(nn.OctreeConv(IN, OUT, nempty=nempty), w, x, 4),
        "strided conv": lambda x, w: layer(nn.OctreeConv(IN, OUT, stride=2, nempty=nempty), w, x, 4),
        "deconv": lambda x, w: layer(nn.OctreeDeconv(IN, OUT, stride=2, nempty=nempty), w.transpose(1, 2), x, 3),
        "max pool": lambda x, _: nn.OctreeMaxPool(nempty)(x, octree, 4),
        "average pool": lambda x, _: nn.OctreeAvgPool([2], 2, nempty)(x, octree, 4),
        "upsample": lambda x, _: nn.OctreeUpsample("nearest", nempty)(x, octree, 3),
        "global average": lambda x, _: nn.OctreeGlobalPool(nempty)(x, octree, 4),
        "voxels": lambda x, _: nn.octree2voxel(x, octree, 3, nempty),
    }


OPERATORS = ["conv", "strided conv", "deconv", "max pool", "average pool", "upsample", "global average", "voxels"]


@pytest.mark.parametrize("name", OPERATORS)
@pytest.mark.parametrize("node_set", NODE_SETS)
def test_values_and_gradients_of_the_operators_agree_in_float64(node_set: str, name: str) -> None:
    torch.manual_seed(0)
    octree, theirs = both(node_set)
    depth, ours = our_operators(octree)[name]
    peer = their_operators(theirs, node_set == "occupied")[name]
    # Its average pooling has no float64, and divides by n + 1e-8.
    dtype, rtol, atol = (torch.float32, 1e-5, 1e-6) if name == "average pool" else (torch.float64, 1e-12, 1e-12)
    x = torch.randn(octree.level(depth).nodes_n, IN, dtype=dtype, requires_grad=True)
    weight = torch.randn(27, IN, OUT, dtype=dtype, requires_grad=True)
    a, b = ours(x, weight), peer(x, weight)
    if name == "average pool" and node_set == "siblings":
        # It gives no row to childless nodes, unlike its maximum and unlike ours.
        a = a[octree.children_n(3) > 0]
    torch.testing.assert_close(a, b, rtol=rtol, atol=atol)
    direction = torch.randn_like(a)
    for grad_a, grad_b in zip(
        *(torch.autograd.grad(y, (x, weight), direction, allow_unused=True) for y in (a, b)), strict=True
    ):
        assert (grad_a is None) == (grad_b is None)
        if grad_a is not None:
            torch.testing.assert_close(grad_a, grad_b, rtol=rtol, atol=atol)


@pytest.mark.parametrize("node_set", NODE_SETS)
def test_the_dense_backend_agrees_too(node_set: str) -> None:
    torch.manual_seed(0)
    octree, theirs = both(node_set, backend="dense")
    nodes = octree.level(4).mask[:, 0].nonzero()[:, 0]
    features = theirs.get_input_feature("NDF", node_set == "occupied")
    conv = ocnn.nn.OctreeConv(7, OUT, nempty=node_set == "occupied")
    rows = torch.zeros(octree.level(4).nodes_n, 7).index_copy(0, nodes, features)
    ours = octree_conv(rows, conv.weights, octree, 4).index_select(0, nodes)
    torch.testing.assert_close(ours, conv(features, theirs, 4), rtol=1e-4, atol=1e-4)
