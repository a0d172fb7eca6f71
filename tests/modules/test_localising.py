from __future__ import annotations

import math
from itertools import product

import pytest
import torch

from tests.octree.clouds import SPEC, random_frames
from tr_grasp.errors import ConfigError
from tr_grasp.modules import load_agent
from tr_grasp.modules.encoders import LocalisingOCNN
from tr_grasp.modules.encoders.readout import MOMENT_SCALE, SpatialReadout
from tr_grasp.modules.encoders.tool_frame import tool_pose
from tr_grasp.octree import Octree

COORDINATES = ("absolute_coordinates", "tcp_coordinates", "tool_coordinates")


def tools(batch_n: int, yaw: float = 0.3) -> torch.Tensor:
    c, s = math.cos(yaw), math.sin(yaw)
    return torch.tensor([[1.0, *SPEC.centre_m, c, s, 0.0, s, -c, 0.0]]).repeat(batch_n, 1)


@pytest.mark.parametrize("switches", list(product([True, False], repeat=3))[:-1])
@pytest.mark.parametrize("attention", [True, False])
def test_every_choice_of_coordinates_is_a_network(switches: tuple[bool, ...], attention: bool) -> None:
    encoder = LocalisingOCNN(SPEC, **dict(zip(COORDINATES, switches, strict=True)), attention=attention)
    features = encoder(random_frames(2), tools(2))
    assert features.shape == (2, 128)
    features.square().sum().backward()
    assert all(parameter.grad.abs().sum() > 0 for parameter in encoder.parameters())


def test_without_coordinates_there_is_nothing_to_localise() -> None:
    with pytest.raises(ConfigError, match="needs one of absolute_coordinates, tcp_coordinates and tool_coordinates"):
        LocalisingOCNN(SPEC, **dict.fromkeys(COORDINATES, False))


def blocks_read(encoder: LocalisingOCNN, proprio: torch.Tensor) -> list[torch.Tensor]:
    """What the readout is given: channels and positions of the blocks."""
    seen: list[torch.Tensor] = []
    handle = encoder.readout.register_forward_pre_hook(lambda _, arguments: seen.extend(arguments[:2]))
    encoder(random_frames(2), proprio)
    handle.remove()
    return seen


def test_each_switch_takes_away_what_its_name_says() -> None:
    here, turned = tools(2), tools(2, yaw=0.8)
    moved = here + torch.tensor([0.0, 0.02, -0.01, 0.03, *[0.0] * 6])

    def depends(proprio: torch.Tensor, **switches: bool) -> bool:
        torch.manual_seed(0)
        encoder = LocalisingOCNN(SPEC, **switches)
        return not all(map(torch.allclose, blocks_read(encoder, here), blocks_read(encoder, proprio)))

    assert depends(moved)
    assert depends(turned)
    assert not depends(turned, tool_coordinates=False)
    assert depends(moved, tool_coordinates=False)
    assert not depends(moved, tool_coordinates=False, tcp_coordinates=False)
    assert depends(moved, absolute_coordinates=False)


def test_attention_reads_positions_in_the_cube_if_there_are_no_others() -> None:
    encoder = LocalisingOCNN(SPEC, tcp_coordinates=False, tool_coordinates=False)
    _, positions = blocks_read(encoder, tools(2))
    octree = Octree(random_frames(2), SPEC.depth)
    first = octree.leaves.keys >> 3 == octree.level(3).keys[0]
    torch.testing.assert_close(positions[0], octree.leaf_points()[first].mean(0))
    assert (encoder.readout.positions_n, encoder.readout.plane) == (3, (0, 1))


@pytest.mark.parametrize(
    ("left_out", "read_n", "plane"),
    [(None, 5, (3, 4)), ("tcp_coordinates", 2, (0, 1)), ("tool_coordinates", 3, (0, 1)), (COORDINATES[0], 5, (3, 4))],
)
def test_moments_are_along_the_axes_of_the_tool_if_positions_are(
    left_out: str | None, read_n: int, plane: tuple[int, int]
) -> None:
    readout = LocalisingOCNN(SPEC, **({left_out: False} if left_out else {})).readout
    assert (readout.positions_n, readout.plane) == (read_n, plane)


def test_moments_are_central_or_about_the_origin() -> None:
    level = Octree(random_frames(1), SPEC.depth).level(3)
    central, raw = (SpatialReadout(4, 1, 1, positions_n=2, plane=(0, 1), central_moments=c) for c in (True, False))
    raw.load_state_dict(central.state_dict())
    blocks, positions = torch.rand(level.nodes_n, 4), torch.randn(level.nodes_n, 2)
    here, moved = (central(blocks, p, level)[0, 2:5] for p in (positions, positions + 3))
    torch.testing.assert_close(here, moved, atol=2e-4, rtol=1e-4)
    x, y = central(blocks, positions, level)[0, :2]
    shift = MOMENT_SCALE * torch.stack([x * x, x * y, y * y])
    torch.testing.assert_close(raw(blocks, positions, level)[0, 2:5], here + shift, atol=1e-5, rtol=1e-4)


def test_the_shipped_policy_fits_the_network() -> None:
    agent, cfg = load_agent("panda")
    assert cfg.network.encoder == "localising_ocnn"
    fresh = LocalisingOCNN(agent.env_spec.octree, cfg.network.features_n)
    fresh.load_state_dict(agent.encoder.module.encoder.encoders[0].state_dict())


def test_without_attention_the_largest_of_every_channel_is_read() -> None:
    encoder = LocalisingOCNN(SPEC, attention=False)
    blocks, _ = blocks_read(encoder, tools(2))
    level = Octree(random_frames(2), SPEC.depth).level(3)
    largest = torch.stack([blocks[level.samples == sample].amax(0) for sample in range(2)])
    expected = encoder.head(torch.cat([largest, tool_pose(tools(2), SPEC).features], dim=1))
    torch.testing.assert_close(encoder(random_frames(2), tools(2)), expected)
