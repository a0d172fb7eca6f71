"""The dense backend against the sparse one, and what it is for: graphs that do not depend on the data."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor, nn

from tests.octree.clouds import SPEC, random_frames
from tr_grasp.errors import ConfigError
from tr_grasp.octree import (
    DenseOctree,
    Octree,
    OctreeConv,
    OctreeDeconv,
    OctreeFrame,
    OctreeSpec,
    SparseOctree,
    morton,
    octree_channel_pool,
    octree_conv,
    octree_deconv,
    octree_global_pool,
    octree_join_children,
    octree_pool,
    octree_to_voxels,
    octree_upsample,
)

NODE_SETS = ["occupied", "siblings"]
JUNK = 1e3
"""What rows without a node hold in these tests: any operator that reads one is off by much."""


def frames_of(kind: str) -> OctreeFrame:
    """Three samples; the first is random, and all are unless the others are named."""
    spec = OctreeSpec(SPEC.origin_m, SPEC.side_m, leaf_capacity=8**SPEC.depth)
    frames = random_frames(3, n=80, spec=spec)
    if kind == "random":
        return frames
    frames[1:] = OctreeFrame.unoccupied(spec, (2,))
    if kind == "one leaf":
        frames.codes[1:, 5] = torch.tensor([0, 8**spec.depth - 1], dtype=torch.int16)
    elif kind == "full":
        frames.codes[1:] = torch.arange(8**spec.depth, dtype=torch.int16)
        frames.features[1:] = torch.rand(2, 8**spec.depth, 7)
    return frames


KINDS = ["random", "empty", "one leaf", "full"]


class Pair:
    """One batch in both backends, and the rows of its nodes in the dense one."""

    def __init__(self, frames: OctreeFrame, depth: int, node_set: str) -> None:
        self.sparse = Octree(frames, depth, node_set)
        self.dense = Octree(frames, depth, node_set, backend="dense")

    def rows(self, depth: int) -> Tensor:
        return self.dense.level(depth).mask[:, 0].nonzero()[:, 0]

    def features(self, depth: int, channels: int = 3) -> tuple[Tensor, Tensor]:
        """Whole numbers, so that maxima are often equal; and the same in the dense rows, among junk."""
        sparse = torch.randn(self.sparse.level(depth).nodes_n, channels, dtype=torch.float64).mul(2).round()
        dense = torch.full((self.dense.level(depth).nodes_n, channels), JUNK, dtype=torch.float64)
        dense[self.rows(depth)] = sparse
        return sparse.requires_grad_(), dense.requires_grad_()

    def compare(self, operator: Callable[..., Tensor], depth: int, to_depth: int | None, *weights: Tensor) -> None:
        """Values and gradients; ``to_depth`` is ``None`` for an operator that does not return nodes."""
        sparse, dense = self.features(depth)
        a, b = operator(sparse, self.sparse, *weights), operator(dense, self.dense, *weights)
        if to_depth is not None:
            assert b.shape[0] == self.dense.level(to_depth).nodes_n
            b = b[self.rows(to_depth)]
        torch.testing.assert_close(a, b, rtol=1e-12, atol=1e-12)
        direction = torch.randn_like(a)
        grads_a = torch.autograd.grad(a, (sparse, *weights), direction)
        grads_b = list(torch.autograd.grad(b, (dense, *weights), direction))
        absent = torch.ones(len(dense), dtype=torch.bool).index_fill(0, self.rows(depth), False)
        assert not grads_b[0][absent].any()
        grads_b[0] = grads_b[0][self.rows(depth)]
        for grad_a, grad_b in zip(grads_a, grads_b, strict=True):
            torch.testing.assert_close(grad_a, grad_b, rtol=1e-12, atol=1e-12)


def weight(taps: int) -> Tensor:
    return torch.randn(taps, 3, 5, dtype=torch.float64, requires_grad=True)


def compare_all(pair: Pair, d: int) -> None:
    """Every operator at depth ``d``, and back to it."""
    for taps in (1, 27):
        pair.compare(lambda x, o, w: octree_conv(x, w, o, d), d, d, weight(taps))
        pair.compare(lambda x, o, w: octree_conv(x, w, o, d, stride=2), d, d - 1, weight(taps))
        pair.compare(lambda x, o, w: octree_deconv(x, w, o, d - 1), d - 1, d, weight(taps))
    for kind in ("max", "average"):
        pair.compare(lambda x, o, kind=kind: octree_pool(x, o, d, kind), d, d - 1)
        pair.compare(lambda x, o, kind=kind: octree_global_pool(x, o, d, kind), d, None)
        pair.compare(lambda x, o, kind=kind: octree_channel_pool(x, kind), d, d)
    pair.compare(lambda x, o: octree_upsample(x, o, d - 1), d - 1, d)
    pair.compare(lambda x, o: octree_to_voxels(x, o, d), d, None)
    pair.compare(lambda x, o: octree_join_children(x, o, d), d, d - 1)
    pair.compare(lambda x, o: o.level(d).pad(x).sum(1), d, None)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("node_set", NODE_SETS)
def test_all_operators_give_the_same_values_and_gradients_in_float64(node_set: str, kind: str) -> None:
    torch.manual_seed(0)
    pair = Pair(frames_of(kind), 4, node_set)
    compare_all(pair, 4)
    compare_all(pair, 3)


@settings(max_examples=8)
@given(seed=st.integers(0, 10_000), depth=st.sampled_from([3, 5, 6]), node_set=st.sampled_from(NODE_SETS))
def test_the_backends_agree_at_other_depths(seed: int, depth: int, node_set: str) -> None:
    torch.manual_seed(seed)
    spec = OctreeSpec(SPEC.origin_m, SPEC.side_m, depth, leaf_capacity=64)
    pair = Pair(random_frames(1, seed, 30, spec), depth, node_set)
    compare_all(pair, 3)
    pair.compare(lambda x, o, w: octree_conv(x, w, o, depth), depth, depth, weight(27))
    pair.compare(lambda x, o: octree_pool(x, o, depth), depth, depth - 1)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("node_set", NODE_SETS)
def test_nodes_and_what_is_known_of_them_are_the_same(node_set: str, kind: str) -> None:
    pair = Pair(frames_of(kind), 4, node_set)
    for depth in (2, 3, 4):
        rows, sparse, dense = pair.rows(depth), pair.sparse.level(depth), pair.dense.level(depth)
        for name in ("keys", "samples", "codes", "cells", "raster"):
            assert torch.equal(getattr(sparse, name), getattr(dense, name)[rows])
    parents = pair.dense.parents(4)[pair.rows(4)]
    assert torch.equal(pair.rows(3)[pair.sparse.parents(4).long()], parents)
    assert torch.equal(pair.sparse.children_n(3), pair.dense.children_n(3)[pair.rows(3)])
    assert (pair.dense.children_n(3)[~pair.dense.level(3).mask[:, 0]] == 1).all()

    assert torch.equal(pair.sparse.node_features(), pair.dense.node_features()[pair.rows(4)])
    assert not pair.dense.node_features()[~pair.dense.level(4).mask[:, 0]].any()
    leaves = pair.dense.leaves.mask[:, 0]
    assert torch.equal(pair.sparse.leaves.keys, pair.dense.leaves.keys[leaves])
    assert torch.equal(pair.sparse.leaf_features(), pair.dense.leaf_features()[leaves])
    assert torch.equal(pair.sparse.leaf_points(), pair.dense.leaf_points()[leaves])


class Network(nn.Module):
    """One of everything, written as encoders are: nothing in it knows of a backend."""

    def __init__(self, node_set: str) -> None:
        super().__init__()
        self.node_set = node_set
        self.backend = "sparse"
        self.conv, self.down, self.up = OctreeConv(7, 8, bias=True), OctreeConv(8, 8, stride=2), OctreeDeconv(8, 8)
        self.norm, self.join, self.head = nn.LayerNorm(8), nn.Linear(64, 8), nn.Linear(8 * 64 + 19, 4)

    def forward(self, codes: Tensor, features: Tensor) -> Tensor:
        octree = Octree(SimpleNamespace(codes=codes, features=features), 4, self.node_set, self.backend)
        x = self.conv(octree.node_features(), octree, 4).relu()
        x = self.norm(self.up(self.down(x, octree, 4), octree, 3) + x)
        x = x * torch.sigmoid(octree_channel_pool(x) + octree_channel_pool(x, "average"))
        mean = octree_global_pool(x, octree, 4, "average")
        x = x * torch.sigmoid(mean).index_select(0, octree.level(4).samples)
        blocks = self.join(octree_join_children(x, octree, 4)).relu() + octree_pool(x, octree, 4)
        coarse = octree_pool(octree_upsample(blocks, octree, 3), octree, 4, "average")
        voxels = octree_to_voxels(octree_pool(coarse, octree, 3), octree, 2).flatten(1)
        counted = octree.level(3).pad((blocks / octree.children_n(3)[:, None].clamp_min(1)).relu()).amax(1)
        highest = octree.leaves.pool(octree.leaf_points())
        return self.head(torch.cat([voxels, mean, counted, highest], dim=1))


@pytest.mark.parametrize("node_set", NODE_SETS)
def test_a_network_runs_unchanged_on_either_backend(node_set: str) -> None:
    torch.manual_seed(0)
    network, frames = Network(node_set), frames_of("empty")
    results = []
    for backend in ("sparse", "dense"):
        network.backend = backend
        out = network(frames.codes, frames.features)
        results.append((out, *torch.autograd.grad(out.square().sum(), list(network.parameters()))))
    for a, b in zip(*results, strict=True):
        torch.testing.assert_close(a, b, rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("node_set", NODE_SETS)
def test_a_dense_network_exports_for_any_batch_and_leaves_nothing_behind(node_set: str) -> None:
    torch.manual_seed(0)
    network, frames, others = Network(node_set).eval(), random_frames(3), random_frames(5, seed=9)
    expected = [network(f.codes, f.features) for f in (frames, others)]
    network.backend = "dense"
    morton._make_on_device.cache_clear()  # the first to ask for the tables is the tracer, whose tensors have no values
    any_batch = {0: torch.export.Dim.DYNAMIC}
    program = torch.export.export(network, (frames.codes, frames.features), dynamic_shapes=(any_batch, any_batch))
    exported = program.module()
    torch.testing.assert_close(exported(others.codes, others.features), expected[1], rtol=1e-5, atol=1e-5)
    torch.testing.assert_close(network(frames.codes, frames.features), expected[0], rtol=1e-5, atol=1e-5)


@pytest.mark.slow
def test_an_exported_network_gives_the_same_in_onnx(tmp_path) -> None:
    runtime = pytest.importorskip("onnxruntime")
    pytest.importorskip("onnxscript")
    torch.manual_seed(0)
    network, frames, others = Network("occupied").eval(), random_frames(3), random_frames(5, seed=9)
    expected = network(others.codes, others.features)
    network.backend = "dense"
    any_batch = {0: torch.export.Dim.DYNAMIC}
    torch.onnx.export(
        network,
        (frames.codes, frames.features),
        tmp_path / "network.onnx",
        dynamo=True,
        dynamic_shapes=(any_batch, any_batch),
        verbose=False,
    )
    session = runtime.InferenceSession(tmp_path / "network.onnx", providers=["CPUExecutionProvider"])
    names = [argument.name for argument in session.get_inputs()]
    (out,) = session.run(None, dict(zip(names, (others.codes.numpy(), others.features.numpy()), strict=True)))
    torch.testing.assert_close(torch.from_numpy(out), expected, rtol=1e-5, atol=1e-5)


def test_the_argument_chooses_the_backend() -> None:
    frames = random_frames(1)
    assert type(Octree(frames, 4)) is type(Octree(frames, 4, backend="sparse")) is SparseOctree
    octree = Octree(frames, 4, "siblings", "dense")
    assert type(octree) is DenseOctree
    assert (octree.node_set, octree.backend) == ("siblings", "dense")
    with pytest.raises(ConfigError, match="did you mean 'dense'"):
        Octree(frames, 4, backend="dens")  # type: ignore[arg-type]


def test_dense_operators_run_under_autocast() -> None:
    frames, conv = random_frames(2), OctreeConv(7, 8)
    octree = Octree(frames, 4, backend="dense")
    with torch.autocast("cpu", dtype=torch.bfloat16):
        out = octree_pool(conv(octree.node_features(), octree, 4), octree, 4)
    assert out.dtype == torch.bfloat16
    out.float().sum().backward()
    assert conv.weight.grad.dtype == torch.float32
