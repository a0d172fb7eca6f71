from __future__ import annotations

import pytest
import torch
from torch import Tensor

from tests.octree.clouds import SPEC, random_frames
from tr_grasp.modules.encoders.attention import OctreeAttention, channel_kernel
from tr_grasp.octree import Octree


@pytest.mark.parametrize(("channels", "kernel"), [(16, 3), (32, 3), (64, 3), (128, 5), (256, 5)])
def test_the_channel_kernel_adapts_to_the_width(channels: int, kernel: int) -> None:
    assert channel_kernel(channels) == kernel
    parameters = list(OctreeAttention(channels).parameters())
    assert sum(parameter.numel() for parameter in parameters) == kernel + 54


def loop_attention(x: Tensor, octree: Octree, depth: int, attention: OctreeAttention) -> Tensor:
    """From the definition, one sample, channel and node at a time."""
    level = octree.level(depth)
    channel_weights, node_weights = attention.channel_conv.weight[0, 0], attention.node_conv.weight[:, :, 0]
    half = len(channel_weights) // 2
    out = x.clone()
    for sample in range(octree.batch_n):
        rows = (level.samples == sample).nonzero().flatten().tolist()
        if not rows:
            continue
        weights = torch.zeros(x.shape[1], dtype=x.dtype)
        for summary in (x[rows].amax(0), x[rows].mean(0)):
            for c in range(x.shape[1]):
                for tap, weight in enumerate(channel_weights):
                    if 0 <= c + tap - half < x.shape[1]:
                        weights[c] = weights[c] + weight * summary[c + tap - half]
        out[rows] = x[rows] * weights.sigmoid()
        row_at = {tuple(level.cells[row].tolist()): row for row in rows}
        summaries = {row: torch.stack([out[row].max(), out[row].mean()]) for row in rows}
        for (cx, cy, cz), row in row_at.items():
            logit = torch.zeros((), dtype=x.dtype)
            for tap in range(27):
                cell = (cx + tap // 9 - 1, cy + tap // 3 % 3 - 1, cz + tap % 3 - 1)
                if cell in row_at:
                    logit = logit + node_weights[tap] @ summaries[row_at[cell]]
            out[row] = out[row] * logit.sigmoid()
    return out


@pytest.mark.parametrize("node_set", ["occupied", "siblings"])
def test_attention_equals_a_slow_loop(node_set: str) -> None:
    torch.manual_seed(0)
    frames = random_frames(3, n=40)
    frames.codes[1] = -1
    octree = Octree(frames, SPEC.depth, node_set)
    attention = OctreeAttention(128).double()
    for parameter in attention.parameters():
        parameter.data.mul_(4)  # away from the flat middle of the sigmoids
    for depth in (2, 3):
        x = torch.randn(octree.level(depth).nodes_n, 128, dtype=torch.float64)
        torch.testing.assert_close(
            attention(x, octree, depth), loop_attention(x, octree, depth, attention), rtol=1e-10, atol=1e-12
        )


def test_the_gradient_of_attention_is_that_of_finite_differences() -> None:
    torch.manual_seed(0)
    octree = Octree(random_frames(2, n=12), SPEC.depth)
    attention = OctreeAttention(16).double()
    x = torch.randn(octree.leaves.nodes_n, 16, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda features: attention(features, octree, SPEC.depth), (x,))


def test_pooling_over_samples_worked_by_hand() -> None:
    frames = random_frames(3, n=2)
    frames.codes[1] = -1
    level = Octree(frames, SPEC.depth).leaves
    assert level.samples.tolist() == [0, 0, 2, 2]
    features = torch.tensor([[1.0], [3.0], [-4.0], [-2.0]])
    largest, mean = level.pool(features, "max"), level.pool(features, "average")
    assert largest.flatten().tolist() == [3.0, 0.0, -2.0]
    assert mean.flatten().tolist() == [2.0, 0.0, -3.0]
