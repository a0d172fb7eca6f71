from __future__ import annotations

import pytest
import torch
import torch.nn.functional as F
from torch import Tensor, nn

from tests.modules.dense_octree import conv, grid, mask, pointwise
from tests.octree.clouds import SPEC, random_frames
from tr_grasp.modules.encoders import ResidualOCNN, build_encoder
from tr_grasp.modules.encoders.residual import ResidualBlock
from tr_grasp.octree import Octree


@pytest.mark.parametrize(
    ("num_blocks", "norm", "three"),
    [(2, "none", 567_474), (4, "none", 634_818), (4, "batch", 638_946), (4, "layer", 638_946), (4, "group", 638_946)],
)
def test_residual_has_the_published_number_of_parameters(num_blocks: int, norm: str, three: int) -> None:
    encoder = build_encoder("residual_ocnn", num_blocks=num_blocks, norm=norm)
    assert sum(parameter.numel() for parameter in encoder.parameters()) == three
    assert encoder.features_n == 510


def dense_block(x: Tensor, block: ResidualBlock, occupied: Tensor) -> Tensor:
    y = pointwise(x, block.reduce, occupied).relu()
    y = conv(y, block.conv.weight, occupied).relu()
    y = pointwise(y, block.expand, occupied)
    skip = x if isinstance(block.skip, nn.Identity) else pointwise(x, block.skip[0], occupied)
    return (y + skip).relu()


@pytest.mark.parametrize("node_set", ["occupied", "siblings"])
def test_residual_is_the_described_network_on_dense_grids(node_set: str) -> None:
    torch.manual_seed(0)
    frames, proprio = random_frames(2), torch.rand(2, 10, dtype=torch.float64)
    encoder = ResidualOCNN(SPEC, node_set, num_blocks=3).double()
    octree = Octree(frames, SPEC.depth, node_set)
    x = grid(octree.node_features(torch.float64), octree, 4)
    for depth, blocks in zip((4, 3), encoder.stages, strict=True):
        for block in blocks:
            x = dense_block(x, block, mask(octree, depth))
        x = F.max_pool3d(x, 2)
    x = encoder.squeeze(x.movedim(1, -1)).relu().flatten(1)
    dense = torch.cat([encoder.octree_head(x).relu(), encoder.proprio_head(proprio).relu()], dim=1)
    torch.testing.assert_close(encoder(frames, proprio), dense, rtol=1e-10, atol=1e-12)


def test_without_proprioception_the_octree_alone_is_encoded() -> None:
    encoder = build_encoder("residual_ocnn", proprio=False, shared_stack=True)
    assert encoder.features_n == 480
    assert sum(parameter.numel() for parameter in encoder.parameters()) == 189_158 - 110
    frames = random_frames(3).reshape(1, 3)
    assert torch.equal(encoder(frames, torch.zeros(1, 3, 10)), encoder(frames, torch.ones(1, 3, 10)))
