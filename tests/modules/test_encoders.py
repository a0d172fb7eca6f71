from __future__ import annotations

import math

import pytest
import torch
import torch.nn.functional as F
from torch import Tensor, nn

from tests.octree.clouds import SPEC, random_cloud, random_frames
from tr_grasp.errors import ConfigError
from tr_grasp.modules.encoders import (
    ENCODERS,
    LocalisingOCNN,
    StackedEncoder,
    VanillaOCNN,
    build_encoder,
    encoder_options,
)
from tr_grasp.modules.encoders.frames import merge_frames, shared_octrees
from tr_grasp.modules.encoders.localising import OFFSET_SCALE
from tr_grasp.modules.encoders.readout import MOMENT_SCALE, SpatialReadout
from tr_grasp.modules.encoders.tool_frame import tool_pose
from tr_grasp.octree import Octree, OctreeFrame, OctreeSpec, octree_from_points, octree_to_voxels

STACK_N = 3
VARIANTS = [
    {"name": "vanilla_ocnn"},
    {"name": "vanilla_ocnn", "shared_stack": True},
    {"name": "vanilla_ocnn", "node_set": "siblings"},
    {"name": "localising_ocnn"},
    {"name": "localising_ocnn", "conv_layers_n": 0},
    {"name": "localising_ocnn", "attention": False},
    {"name": "localising_ocnn", "tcp_coordinates": False, "tool_coordinates": False},
    {"name": "vanilla_ocnn", "norm": "batch", "proprio": False},
    {"name": "residual_ocnn"},
    {"name": "residual_ocnn", "num_blocks": 1, "norm": "batch", "node_set": "siblings"},
    {"name": "residual_ocnn", "num_blocks": 1, "norm": "group"},
    {"name": "o_ahrnet"},
    {"name": "o_ahrnet", "norm": "layer", "shared_stack": True},
    {"name": "point_net"},
    {"name": "point_net", "norm": "batch"},
    {"name": "state_mlp"},
]
OCTREE_VARIANTS = [variant for variant in VARIANTS if variant["name"] != "state_mlp"]
every_variant = pytest.mark.parametrize("variant", VARIANTS, ids=lambda v: "-".join(map(str, v.values())))
every_octree_variant = pytest.mark.parametrize("variant", OCTREE_VARIANTS, ids=lambda v: "-".join(map(str, v.values())))


def random_proprio(*batch: int) -> Tensor:
    """Tools over the cube that point down."""
    position = torch.tensor(SPEC.centre_m) + (torch.rand(*batch, 3) - 0.5) * SPEC.side_m
    yaw = torch.rand(*batch) * 2 * math.pi
    c, s, zero = yaw.cos(), yaw.sin(), torch.zeros(*batch)
    return torch.cat([torch.rand(*batch, 1), position, torch.stack([c, s, zero, s, -c, zero], dim=-1)], dim=-1)


def random_batch(batch_n: int) -> tuple[OctreeFrame, Tensor]:
    return random_frames(batch_n * STACK_N).reshape(batch_n, STACK_N), random_proprio(batch_n, STACK_N)


def build(variant: dict) -> StackedEncoder:
    torch.manual_seed(0)
    return build_encoder(**variant, spec=SPEC)


def parameters_n(module: nn.Module) -> int:
    return sum(parameter.numel() for parameter in module.parameters())


@every_variant
def test_features_have_the_announced_size_and_are_finite(variant: dict) -> None:
    encoder = build(variant)
    features = encoder(*random_batch(4))
    assert features.shape == (4, encoder.features_n)
    assert features.isfinite().all()


@every_variant
def test_a_batch_is_encoded_like_its_samples_one_by_one(variant: dict) -> None:
    encoder = build(variant).eval()
    frames, proprio = random_batch(4)
    alone = torch.cat([encoder(frames[i : i + 1], proprio[i : i + 1]) for i in range(4)])
    torch.testing.assert_close(encoder(frames, proprio), alone, rtol=1e-4, atol=1e-5)


@every_variant
def test_the_order_of_points_and_of_leaves_does_not_matter(variant: dict) -> None:
    encoder = build(variant)
    cloud = random_cloud(0, 400, spread=0.5)
    order = torch.randperm(400).numpy()
    a = octree_from_points(*cloud, SPEC).expand(1, STACK_N)
    b = octree_from_points(*(array[order] for array in cloud), SPEC)
    slots = torch.randperm(SPEC.leaf_capacity)
    b = OctreeFrame(codes=b.codes[slots], features=b.features[slots], batch_size=[]).expand(1, STACK_N)
    proprio = random_proprio(1, STACK_N)
    torch.testing.assert_close(encoder(a, proprio), encoder(b, proprio), rtol=1e-3, atol=1e-3)


@every_variant
def test_gradients_reach_every_parameter(variant: dict) -> None:
    encoder = build(variant)
    encoder(*random_batch(6)).square().sum().backward()
    for name, parameter in encoder.named_parameters():
        assert parameter.grad is not None, name
        assert parameter.grad.abs().sum() > 0, name


@every_variant
def test_samples_of_a_batch_do_not_influence_each_other(variant: dict) -> None:
    encoder = build(variant).eval()
    frames, proprio = random_batch(3)
    proprio.requires_grad_()
    frames.features = frames.features.float().requires_grad_()
    features = encoder(frames, proprio)[1].square().sum()
    seen = torch.autograd.grad(features, [proprio, frames.features], materialize_grads=True)
    for gradient, is_read in zip(seen, (variant.get("proprio", True), variant["name"] != "state_mlp"), strict=True):
        assert (gradient[1].abs().sum() > 0) == is_read
        assert not gradient[[0, 2]].any()


@every_variant
def test_empty_frames_give_finite_features_and_gradients(variant: dict) -> None:
    encoder = build(variant)
    frames, proprio = random_batch(2)
    frames[0] = OctreeFrame.unoccupied(SPEC, (STACK_N,))
    for batch in (frames, frames[:1]):
        features = encoder(batch, proprio[: len(batch)])
        assert features.isfinite().all()
        features.square().sum().backward()
    assert all(parameter.grad.isfinite().all() for parameter in encoder.parameters() if parameter.grad is not None)


@every_variant
def test_encoders_run_under_autocast(variant: dict) -> None:
    encoder = build(variant).eval()
    frames, proprio = random_batch(2)
    with torch.autocast("cpu", dtype=torch.bfloat16):
        features = encoder(frames, proprio)
    torch.testing.assert_close(features.float(), encoder(frames, proprio), rtol=0.1, atol=0.15)
    features.float().sum().backward()


@pytest.mark.parametrize(("channels", "one", "three"), [(7, 226_494, 679_482), (4, 223_902, 671_706)])
def test_vanilla_has_the_published_number_of_parameters(channels: int, one: int, three: int) -> None:
    spec = OctreeSpec(SPEC.origin_m, SPEC.side_m, colour=channels == 7)
    assert parameters_n(VanillaOCNN(spec)) == one
    assert parameters_n(build_encoder("vanilla_ocnn", in_channels=channels)) == three
    assert parameters_n(build_encoder("vanilla_ocnn", in_channels=channels, shared_stack=True)) == one
    assert build_encoder("vanilla_ocnn", in_channels=channels).features_n == 510


@pytest.mark.parametrize("node_set", ["occupied", "siblings"])
def test_vanilla_is_the_published_network_on_dense_grids(node_set: str) -> None:
    frames, proprio = random_frames(4), random_proprio(4)
    encoder = VanillaOCNN(SPEC, node_set)
    octree = Octree(frames, SPEC.depth, node_set)
    x = octree_to_voxels(octree.node_features(), octree, 4)
    for depth, conv in zip((4, 3), encoder.convs, strict=True):
        level = octree.level(depth)
        mask = octree_to_voxels(torch.ones(level.nodes_n, 1), octree, depth)
        kernel = conv.weight.view(3, 3, 3, *conv.weight.shape[1:]).permute(4, 3, 0, 1, 2)
        x = F.max_pool3d(F.conv3d(x, kernel, padding=1).relu() * mask, 2)
    x = encoder.squeeze(x.permute(0, 2, 3, 4, 1)).relu().flatten(1)
    dense = torch.cat([encoder.octree_head(x).relu(), encoder.proprio_head(proprio).relu()], dim=1)
    torch.testing.assert_close(encoder(frames, proprio), dense)


@pytest.mark.parametrize("name", sorted(set(ENCODERS) - {"image_cnn"}))
@pytest.mark.parametrize("depth", [3, 4, 5, 6])
def test_encoders_fit_every_depth(depth: int, name: str) -> None:
    spec = OctreeSpec(SPEC.origin_m, SPEC.side_m, depth, colour=False)
    frames, proprio = random_frames(2, spec=spec)[:, None], random_proprio(2, 1)
    encoder = build_encoder(name, in_channels=4, spec=spec, stack_n=1)
    features = encoder(frames, proprio)
    assert features.shape == (2, encoder.features_n)
    features.square().sum().backward()
    assert all(parameter.grad.isfinite().all() for parameter in encoder.parameters())


def test_separate_encoders_differ_and_a_shared_one_encodes_all_frames_alike() -> None:
    frames, proprio = random_batch(2)
    backwards = frames.flip(1), proprio.flip(1)
    for shared in (True, False):
        encoder = build_encoder("vanilla_ocnn", spec=SPEC, shared_stack=shared)
        forth = encoder(frames, proprio).view(2, STACK_N, -1)
        back = encoder(*backwards).view(2, STACK_N, -1).flip(1)
        assert torch.allclose(forth, back, atol=1e-6) == shared
        assert not torch.allclose(forth[:, 0], forth[:, 1], atol=1e-3)


def test_localising_always_shares_its_weights_over_the_stack() -> None:
    alone = parameters_n(LocalisingOCNN(SPEC, features_n=64))
    encoder = build_encoder("localising_ocnn", spec=SPEC, features_n=64)
    assert parameters_n(encoder) == alone
    assert encoder.features_n == 3 * 64


def test_a_gripper_turned_by_half_a_turn_is_the_same_gripper() -> None:
    frames, proprio = random_frames(8), random_proprio(8)
    half_turn = proprio * torch.tensor([1.0] * 4 + [-1.0] * 6)
    encoder = LocalisingOCNN(SPEC)
    assert torch.equal(encoder(frames, proprio), encoder(frames, half_turn))
    quarter_turn = torch.cat([proprio[:, :4], proprio[:, 7:], -proprio[:, 4:7]], dim=1)
    assert not torch.allclose(encoder(frames, proprio), encoder(frames, quarter_turn), atol=1e-3)


def test_the_tool_in_the_cube_worked_by_hand() -> None:
    corner = [o + SPEC.side_m for o in SPEC.origin_m]
    proprio = torch.tensor([[0.5, *corner, 0.0, -1.0, 0.0, -1.0, 0.0, 0.0]])  # y axis along -x: the far side
    tool = tool_pose(proprio, SPEC)
    torch.testing.assert_close(tool.position, torch.ones(1, 3))
    assert tool.axes.tolist() == [[[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]]
    torch.testing.assert_close(tool.features, torch.tensor([[0.5, 1, 1, 1, 1, 0, 0, 0]]))


def test_a_head_without_preference_reads_mean_and_covariance() -> None:
    frames = random_frames(3)
    frames.codes[1] = -1
    level = Octree(frames, SPEC.depth).level(3)
    readout = SpatialReadout(channels=4, heads_n=2, values_n=1)
    nn.init.zeros_(readout.logits.weight)
    blocks, offsets = torch.rand(level.nodes_n, 4), torch.randn(level.nodes_n, 5)
    features = readout(blocks, offsets, level)
    assert features.shape == (3, readout.features_n)
    heads = features[:, :-4].view(3, 2, -1)
    for sample in (0, 2):
        mine = level.samples == sample
        covariance = MOMENT_SCALE * torch.cov(offsets[mine, 3:].T, correction=0)
        expected = torch.cat(
            [offsets[mine].mean(0), covariance[[0, 0, 1], [0, 1, 1]], readout.values(blocks[mine]).mean(0)]
        )
        torch.testing.assert_close(heads[sample], expected.expand(2, -1))
        torch.testing.assert_close(features[sample, -4:], blocks[mine].amax(0))
    assert not features[1].any()


def test_localising_reads_the_mean_point_of_each_block_from_the_tool() -> None:
    frames, proprio = random_frames(3), random_proprio(3)
    encoder, seen = LocalisingOCNN(SPEC), []
    encoder.readout.register_forward_pre_hook(lambda _, arguments: seen.append(arguments))
    encoder(frames, proprio)
    _, offsets, blocks = seen[0]
    octree, tool = Octree(frames, SPEC.depth), tool_pose(proprio, SPEC)
    points = octree.leaf_points()
    assert offsets.shape == (blocks.nodes_n, 5)
    for row, key in enumerate(blocks.keys):
        sample = blocks.samples[row]
        offset = OFFSET_SCALE * (points[octree.leaves.keys >> 3 == key].mean(0) - tool.position[sample])
        torch.testing.assert_close(offsets[row], torch.cat([offset, tool.axes[sample] @ offset]), atol=1e-5, rtol=1e-4)


@every_octree_variant
def test_frames_of_another_octree_are_refused(variant: dict) -> None:
    encoder = build(variant)
    grey = OctreeSpec(SPEC.origin_m, SPEC.side_m, colour=False)
    deep = OctreeSpec(SPEC.origin_m, SPEC.side_m, depth=5)
    for spec, match in ((grey, "must have 7 channels.*got 4"), (deep, "leaves of depth 4.*of a deeper one")):
        frames = random_frames(STACK_N, spec=spec).reshape(1, STACK_N)
        with pytest.raises(ValueError, match=match):
            encoder(frames, random_proprio(1, STACK_N))


def test_unknown_names_and_foreign_channels_are_refused() -> None:
    with pytest.raises(ConfigError, match="did you mean 'vanilla_ocnn'"):
        build_encoder("vanila_ocnn")
    with pytest.raises(ConfigError, match="in_channels must be 7"):
        build_encoder("vanilla_ocnn", in_channels=4, spec=SPEC)


def test_options_that_a_network_lacks_are_refused_unless_they_change_nothing() -> None:
    with pytest.raises(ConfigError, match=r"vanilla_ocnn has no option 'num_blocks' .* Valid: node_set, norm,"):
        build_encoder("vanilla_ocnn", num_blocks=4)
    with pytest.raises(ConfigError, match="no option 'blocks'"):
        build_encoder("residual_ocnn", blocks=4)
    everything = {key: value for name in ENCODERS for key, value in encoder_options(name).items()}
    for name in ENCODERS:
        build_encoder(name, **everything, spec=SPEC)


def test_an_option_has_the_same_default_in_all_networks() -> None:
    defaults: dict[str, object] = {}
    for name in ENCODERS:
        for key, value in encoder_options(name).items():
            assert defaults.setdefault(key, value) == value, key


@pytest.mark.parametrize(
    ("option", "match"),
    [
        ({"node_set": "all"}, "unknown node set 'all'"),
        ({"norm": "instance"}, "unknown normalisation 'instance'.*batch, group, layer, none"),
        ({"norm_momentum": 0.0}, r"norm_momentum must be in \(0, 1\], got 0.0"),
        ({"num_blocks": 0}, "num_blocks must be at least 1, got 0"),
    ],
)
def test_options_outside_their_range_are_refused(option: dict, match: str) -> None:
    with pytest.raises(ConfigError, match=match):
        build_encoder("residual_ocnn", **option)


def test_a_stack_of_another_length_is_refused() -> None:
    encoder = build_encoder("localising_ocnn", spec=SPEC, stack_n=2)
    with pytest.raises(ValueError, match=r"\(B, 2\)"):
        encoder(*random_batch(2))


def test_equal_frames_share_one_octree_only_where_that_is_asked_for() -> None:
    frames, others = random_frames(2), random_frames(2, seed=9)
    assert merge_frames(frames, SPEC) is not merge_frames(frames, SPEC)
    with shared_octrees():
        first = merge_frames(frames, SPEC)
        assert merge_frames(frames.clone(), SPEC) is first
        assert merge_frames(others, SPEC) is not first
        assert merge_frames(frames, SPEC, "siblings") is not first
        recoloured = frames.clone()
        recoloured.features[0, 0, 4] += 0.25
        assert merge_frames(recoloured, SPEC) is not first
    with shared_octrees():
        assert merge_frames(frames, SPEC) is not first
