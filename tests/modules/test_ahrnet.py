from __future__ import annotations

import pytest
import torch
import torch.nn.functional as F
from torch import Tensor

from tests.modules.dense_octree import conv, deconv, grid, mask, pointwise
from tests.octree.clouds import SPEC, random_frames
from tr_grasp.modules.encoders import OAHRNet, OctreeAttention, build_encoder
from tr_grasp.modules.encoders.ahrnet import AttentionUnit, Resample
from tr_grasp.octree import Octree, OctreeDeconv, OctreeSpec


def parameters_n(module: torch.nn.Module) -> int:
    return sum(parameter.numel() for parameter in module.parameters())


def test_o_ahrnet_has_the_published_number_of_parameters() -> None:
    assert parameters_n(build_encoder("o_ahrnet")) == 2_661_372
    assert parameters_n(build_encoder("o_ahrnet", shared_stack=True)) == 887_124
    encoder = OAHRNet(SPEC)
    assert [parameters_n(unit) for stage in encoder.stages for unit in stage.values()] == [55_353] * 6
    assert [parameters_n(exchange) // 27_648 for exchange in encoder.exchanges] == [1, 5, 8]


@pytest.mark.parametrize(
    ("depth", "branches_n"), [(3, [1, 2]), (4, [1, 2, 3]), (5, [1, 2, 3, 4]), (6, [1, 2, 3, 4, 5])]
)
def test_there_is_a_stage_and_a_branch_for_each_depth(depth: int, branches_n: list[int]) -> None:
    encoder = OAHRNet(OctreeSpec(SPEC.origin_m, SPEC.side_m, depth))
    assert [len(stage) for stage in encoder.stages] == branches_n
    assert encoder.squeeze.in_features == 32 * len(branches_n)


class DenseReference:
    """O-AHRNet on full grids, from its description, for depth 4."""

    def __init__(self, encoder: OAHRNet, octree: Octree) -> None:
        self.encoder = encoder
        self.octree = octree
        self.masks = {depth: mask(octree, depth) for depth in (4, 3, 2)}

    def __call__(self) -> Tensor:
        stages, exchanges = self.encoder.stages, self.encoder.exchanges
        up = down = self.path
        x4 = self.unit(self.stem(), stages[0]["4"], 4)

        x4, x3 = x4.relu(), down(x4, exchanges[0].paths["4to3"]).relu()
        x4, x3 = self.unit(x4, stages[1]["4"], 4), self.unit(x3, stages[1]["3"], 3)

        paths = exchanges[1].paths
        x4, x3, x2 = (
            (x4 + up(x3, paths["3to4"])).relu(),
            (down(x4, paths["4to3"]) + x3).relu(),
            (down(x4, paths["4to2"]) + down(x3, paths["3to2"])).relu(),
        )
        x4, x3, x2 = (self.unit(x, stages[2][str(depth)], depth) for x, depth in ((x4, 4), (x3, 3), (x2, 2)))

        paths = exchanges[2].paths
        x4, x3, x2 = (
            (x4 + up(x3, paths["3to4"]) + up(x2, paths["2to4"])).relu(),
            (down(x4, paths["4to3"]) + x3 + up(x2, paths["2to3"])).relu(),
            (down(x4, paths["4to2"]) + down(x3, paths["3to2"]) + x2).relu(),
        )
        x = torch.cat([F.max_pool3d(x4, 4), F.max_pool3d(x3, 2), x2], dim=1)
        x = self.encoder.squeeze(x.movedim(1, -1)).relu().flatten(1)
        return self.encoder.octree_head(x).relu()

    def stem(self) -> Tensor:
        block, occupied = self.encoder.stem, self.masks[4]
        x = grid(self.octree.node_features(torch.float64), self.octree, 4)
        y = pointwise(x, block.reduce, occupied).relu()
        y = conv(y, block.conv.weight, occupied).relu()
        return (pointwise(y, block.expand, occupied) + pointwise(x, block.skip[0], occupied)).relu()

    def unit(self, x: Tensor, unit: AttentionUnit, depth: int) -> Tensor:
        occupied = self.masks[depth]
        y = conv(x, unit.convs[0].weight, occupied).relu()
        y = conv(y, unit.convs[1].weight, occupied)
        return (self.attention(y, unit.attention, occupied) + x).relu()

    def attention(self, x: Tensor, attention: OctreeAttention, occupied: Tensor) -> Tensor:
        largest = x.masked_fill(occupied == 0, -torch.inf).amax((2, 3, 4))
        mean = x.sum((2, 3, 4)) / occupied.sum((2, 3, 4))
        weights = sum(attention.channel_conv(values[:, None])[:, 0] for values in (largest, mean)).sigmoid()
        x = x * weights[:, :, None, None, None]
        summary = torch.stack([x.amax(1), x.mean(1)], dim=1) * occupied
        return x * conv(summary, attention.node_conv.weight, occupied).sigmoid()

    def path(self, x: Tensor, path: Resample) -> Tensor:
        for i, (depth, layer) in enumerate(zip(path.depths, path.convs, strict=True)):
            x = x.relu() if i else x
            if isinstance(layer, OctreeDeconv):
                x = deconv(x, layer.weight, self.masks[depth + 1])
            else:
                x = conv(x, layer.weight, self.masks[depth - 1], stride=2)
        return x


def test_o_ahrnet_is_the_described_network_on_dense_grids() -> None:
    torch.manual_seed(0)
    frames = random_frames(2)
    encoder = OAHRNet(SPEC, proprio=False).double()
    for name, parameter in encoder.named_parameters():
        if "attention" in name:
            parameter.data.mul_(5)  # so that attention differs from a factor that is the same everywhere
    dense = DenseReference(encoder, Octree(frames, SPEC.depth))()
    sparse = encoder(frames, torch.zeros(2, 10, dtype=torch.float64))
    assert dense.std() > 0.01
    torch.testing.assert_close(sparse, dense, rtol=1e-9, atol=1e-11)
    ours, theirs = (torch.autograd.grad(out.square().sum(), list(encoder.parameters())) for out in (sparse, dense))
    for ours_, theirs_ in zip(ours, theirs, strict=True):
        torch.testing.assert_close(ours_, theirs_, rtol=1e-7, atol=1e-10)
