from __future__ import annotations

import pytest
import torch

from tests.octree.clouds import SPEC, random_frames
from tr_grasp.modules.encoders import ImageCNN, PointNet, StackedEncoder, StateMLP, build_encoder
from tr_grasp.modules.encoders.tool_frame import tool_pose
from tr_grasp.octree import Octree


@pytest.mark.parametrize("size", [(16, 16), (64, 64), (48, 90)])
def test_images_of_any_size_give_features_and_gradients(size: tuple[int, int]) -> None:
    encoder = ImageCNN(features_n=32)
    features = encoder(torch.rand(3, 4, *size), torch.rand(3, 10))
    assert features.shape == (3, 32)
    features.square().sum().backward()
    assert all(parameter.grad.abs().sum() > 0 for parameter in encoder.parameters())


@pytest.mark.parametrize("shared", [True, False])
def test_images_are_stacked_like_frames(shared: bool) -> None:
    encoder = StackedEncoder(lambda: ImageCNN(features_n=32), stack_n=3, shared=shared)
    image, proprio = torch.rand(2, 3, 4, 32, 32), torch.rand(2, 3, 10)
    features = encoder(image, proprio)
    assert features.shape == (2, 96)
    torch.testing.assert_close(features[:, 32:64], encoder.encoders[0 if shared else 1](image[:, 1], proprio[:, 1]))
    with pytest.raises(ValueError, match=r"\(B, 3\), got \(2, 2\)"):
        encoder(image[:, :2], proprio[:, :2])


def test_an_image_encoder_can_do_without_proprioception() -> None:
    encoder = ImageCNN(image_channels=1, features_n=32, proprio=False)
    assert encoder(torch.rand(3, 1, 32, 32), torch.rand(3, 10)).shape == (3, 32)


def test_the_state_encoder_looks_at_no_octree() -> None:
    encoder = build_encoder("state_mlp", spec=SPEC, stack_n=1)
    proprio = torch.rand(2, 1, 10)
    a, b = (encoder(random_frames(2, seed)[:, None], proprio) for seed in (0, 10))
    assert torch.equal(a, b)


def test_a_privileged_state_is_read_if_there_is_one() -> None:
    encoder = StackedEncoder(lambda: StateMLP(SPEC, features_n=24, state_n=7), stack_n=2, shared=True)
    state, proprio = torch.rand(3, 2, 7), torch.rand(3, 2, 10)
    assert encoder(state, proprio).shape == (3, 48)
    assert not torch.equal(encoder(state, proprio), encoder(2 * state, proprio))


def test_points_are_pooled_over_each_sample() -> None:
    frames, proprio = random_frames(3), torch.rand(3, 10)
    frames.codes[1] = -1
    encoder = PointNet(SPEC)
    octree = Octree(frames, SPEC.depth)
    described = encoder.describe(torch.cat([octree.leaf_points(), octree.leaf_features()], dim=1))
    largest = [described[octree.leaves.samples == sample] for sample in range(3)]
    largest = torch.stack([points.amax(0) if len(points) else torch.zeros(128) for points in largest])
    expected = encoder.head(torch.cat([largest, tool_pose(proprio, SPEC).features], dim=1))
    torch.testing.assert_close(encoder(frames, proprio), expected)
