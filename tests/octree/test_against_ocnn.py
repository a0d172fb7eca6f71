"""The peer library as an oracle, where it is installed; every law here is also tested against dense grids."""

from __future__ import annotations

import math

import pytest
import torch

from benchmarks._ocnn import build_octree, import_ocnn, merge
from tests.octree.clouds import SPEC, random_cloud
from tr_grasp.octree import Octree, octree_conv, octree_deconv, octree_from_points, octree_pool

ocnn = import_ocnn()
pytestmark = pytest.mark.skipif(ocnn is None, reason="ocnn is not installed")

CLOUDS = [[array.astype("float32") for array in random_cloud(seed, spread=0.7)] for seed in range(3)]


@pytest.mark.parametrize("node_set", ["occupied", "siblings"])
def test_nodes_features_convolutions_and_pooling_agree(node_set: str) -> None:
    frames = torch.stack([octree_from_points(*cloud, SPEC) for cloud in CLOUDS])
    ours = Octree(frames, SPEC.depth, node_set)
    theirs = merge(ocnn, [build_octree(ocnn, cloud, SPEC) for cloud in CLOUDS])
    nempty = node_set == "occupied"

    features = theirs.get_input_feature("NDF", nempty)
    features[:, 3] *= 2 / math.sqrt(3)  # their distance is in half leaf edges
    torch.testing.assert_close(ours.node_features(), features, atol=2e-3, rtol=0)

    conv, strided = (ocnn.nn.OctreeConv(7, 5, stride=stride, nempty=nempty) for stride in (1, 2))
    expected = conv(features, theirs, 4)
    torch.testing.assert_close(octree_conv(features, conv.weights, ours, 4), expected, atol=1e-4, rtol=1e-4)
    pooled = ocnn.nn.OctreeMaxPool(nempty)(expected, theirs, 4)
    torch.testing.assert_close(octree_pool(expected, ours, 4), pooled)
    deconv = ocnn.nn.OctreeDeconv(5, 4, stride=2, nempty=nempty)
    finer = deconv(pooled, theirs, 3)
    torch.testing.assert_close(
        octree_deconv(pooled, deconv.weights.transpose(1, 2), ours, 3), finer, atol=1e-4, rtol=1e-4
    )
    coarse = strided(features, theirs, 4)
    torch.testing.assert_close(octree_conv(features, strided.weights, ours, 4, stride=2), coarse, atol=1e-4, rtol=1e-4)
