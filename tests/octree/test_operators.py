from __future__ import annotations

from collections.abc import Callable

import pytest
import torch
import torch.nn.functional as F
from torch import Tensor

from tests.octree.clouds import SPEC, random_frames
from tr_grasp.errors import ConfigError
from tr_grasp.octree import (
    Octree,
    OctreeConv,
    OctreeDeconv,
    OctreeFrame,
    OctreePool,
    octree_channel_pool,
    octree_conv,
    octree_deconv,
    octree_global_pool,
    octree_join_children,
    octree_pool,
    octree_to_voxels,
    octree_upsample,
)
from tr_grasp.octree import gather_conv as gather_conv_module
from tr_grasp.octree.gather_conv import GatherConv
from tr_grasp.octree.products import add_product, product
from tr_grasp.octree.reads import adjoint_table, by_layers, in_one_part
from tr_grasp.octree.runs import Turns

NODE_SETS = ["occupied", "siblings"]


def make_octree(node_set: str, batch_n: int = 3, n: int = 150) -> Octree:
    return Octree(random_frames(batch_n, n=n), SPEC.depth, node_set)


def at_nodes(grid: Tensor, octree: Octree, depth: int) -> Tensor:
    """Read ``(batch, channels, x, y, z)`` at the nodes, by their cells."""
    level = octree.level(depth)
    x, y, z = level.cells.unbind(1)
    return grid[level.samples, :, x, y, z]


def slow_grid(features: Tensor, octree: Octree, depth: int, fill: float = 0.0) -> Tensor:
    level = octree.level(depth)
    grid = features.new_full((octree.batch_n, features.shape[1], *[2**depth] * 3), fill)
    for row, (sample, (x, y, z)) in enumerate(zip(level.samples.tolist(), level.cells.tolist(), strict=True)):
        grid[sample, :, x, y, z] = features[row]
    return grid


def dense_weight(weight: Tensor) -> Tensor:
    """``(taps, in, out)`` as ``Conv3d.weight``."""
    side = round(len(weight) ** (1 / 3))
    return weight.view(side, side, side, *weight.shape[1:]).permute(4, 3, 0, 1, 2)


def has_children(octree: Octree, depth: int) -> Tensor:
    """``(n, 1)``: 1 for a node of ``depth`` with at least one child."""
    ones = torch.ones(octree.level(depth + 1).nodes_n, 1, dtype=torch.float64)
    return at_nodes(F.max_pool3d(octree_to_voxels(ones, octree, depth + 1), 2), octree, depth)


def assert_same_values_and_gradients(fast: Callable, slow: Callable, *inputs: Tensor) -> None:
    for tensor in inputs:
        tensor.requires_grad_()
    a, b = fast(*inputs), slow(*inputs)
    torch.testing.assert_close(a, b)
    direction = torch.randn_like(a)
    for grad_a, grad_b in zip(
        torch.autograd.grad(a, inputs, direction), torch.autograd.grad(b, inputs, direction), strict=True
    ):
        torch.testing.assert_close(grad_a, grad_b)


@pytest.mark.parametrize("node_set", NODE_SETS)
@pytest.mark.parametrize("depth", [2, 3, 4])
def test_voxels_hold_the_nodes_at_their_cells(node_set: str, depth: int) -> None:
    octree = make_octree(node_set)
    features = torch.randn(octree.level(depth).nodes_n, 2)
    assert torch.equal(octree_to_voxels(features, octree, depth), slow_grid(features, octree, depth))


@pytest.mark.parametrize("node_set", NODE_SETS)
@pytest.mark.parametrize("taps", [1, 27])
@pytest.mark.parametrize("stride", [1, 2])
def test_convolution_equals_the_dense_one_at_the_nodes(node_set: str, taps: int, stride: int) -> None:
    octree = make_octree(node_set)
    features = torch.randn(octree.level(4).nodes_n, 3, dtype=torch.float64)
    weight = torch.randn(taps, 3, 5, dtype=torch.float64)

    def dense(features: Tensor, weight: Tensor) -> Tensor:
        grid = octree_to_voxels(features, octree, 4)
        grid = F.conv3d(grid, dense_weight(weight), stride=stride, padding=1 if taps == 27 else 0)
        return at_nodes(grid, octree, 4) if stride == 1 else at_nodes(grid, octree, 3) * has_children(octree, 3)

    assert_same_values_and_gradients(lambda x, w: octree_conv(x, w, octree, 4, stride), dense, features, weight)


@pytest.mark.parametrize("node_set", NODE_SETS)
@pytest.mark.parametrize("taps", [1, 27])
def test_deconvolution_equals_the_dense_transposed_one_at_the_nodes(node_set: str, taps: int) -> None:
    octree = make_octree(node_set)
    features = torch.randn(octree.level(3).nodes_n, 3, dtype=torch.float64)
    weight = torch.randn(taps, 3, 5, dtype=torch.float64)

    def dense(features: Tensor, weight: Tensor) -> Tensor:
        grid = octree_to_voxels(features * has_children(octree, 3), octree, 3)
        kernel = dense_weight(weight).transpose(0, 1)
        padding = 1 if taps == 27 else 0
        grid = F.conv_transpose3d(grid, kernel, stride=2, padding=padding, output_padding=1)
        return at_nodes(grid, octree, 4)

    assert_same_values_and_gradients(lambda x, w: octree_deconv(x, w, octree, 3), dense, features, weight)


def test_a_single_tap_moves_features_to_the_next_cell_along_x() -> None:
    codes = torch.full((1, 512), -1, dtype=torch.int16)
    codes[0, :2] = torch.tensor([0, 4])  # cells (0, 0, 0) and (1, 0, 0)
    frame = OctreeFrame(codes=codes, features=torch.zeros(1, 512, 7, dtype=torch.float16), batch_size=[1])
    weight = torch.zeros(27, 1, 1)
    weight[4] = 1.0  # row-major: x - 1, same y, same z
    out = octree_conv(torch.tensor([[5.0], [7.0]]), weight, Octree(frame, SPEC.depth), 4)
    assert out.tolist() == [[0.0], [5.0]]


@pytest.mark.parametrize("node_set", NODE_SETS)
@pytest.mark.parametrize("depth", [4, 3, 2])
def test_pooling_equals_the_dense_one_over_the_children_that_exist(node_set: str, depth: int) -> None:
    octree = make_octree(node_set)
    features = torch.randn(octree.level(depth).nodes_n, 3, dtype=torch.float64)

    def dense_max(features: Tensor) -> Tensor:
        grid = F.max_pool3d(slow_grid(features, octree, depth, fill=-torch.inf), 2)
        return at_nodes(grid, octree, depth - 1).masked_fill(has_children(octree, depth - 1) == 0, 0)

    def dense_average(features: Tensor) -> Tensor:
        sums = F.avg_pool3d(octree_to_voxels(features, octree, depth), 2)
        counts = F.avg_pool3d(octree_to_voxels(torch.ones_like(features), octree, depth), 2)
        return at_nodes(sums / counts.clamp_min(1e-9), octree, depth - 1)

    assert_same_values_and_gradients(lambda x: octree_pool(x, octree, depth, "max"), dense_max, features)
    assert_same_values_and_gradients(lambda x: octree_pool(x, octree, depth, "average"), dense_average, features)


@pytest.mark.parametrize("node_set", NODE_SETS)
@pytest.mark.parametrize("depth", [2, 3])
def test_upsampling_equals_the_dense_one_at_the_nodes(node_set: str, depth: int) -> None:
    octree = make_octree(node_set)
    features = torch.randn(octree.level(depth).nodes_n, 3, dtype=torch.float64)

    def dense(features: Tensor) -> Tensor:
        return at_nodes(F.interpolate(octree_to_voxels(features, octree, depth), scale_factor=2), octree, depth + 1)

    assert_same_values_and_gradients(lambda x: octree_upsample(x, octree, depth), dense, features)


@pytest.mark.parametrize("node_set", NODE_SETS)
@pytest.mark.parametrize("depth", [2, 4])
def test_global_pooling_equals_a_loop_over_the_samples(node_set: str, depth: int) -> None:
    octree = make_octree(node_set)
    level = octree.level(depth)
    features = torch.randn(level.nodes_n, 3, dtype=torch.float64)
    for kind, reduce in {"max": lambda x: x.amax(0), "average": lambda x: x.mean(0)}.items():

        def loop(features: Tensor, reduce: Callable = reduce) -> Tensor:
            return torch.stack([reduce(features[level.samples == sample]) for sample in range(octree.batch_n)])

        assert_same_values_and_gradients(lambda x, k=kind: octree_global_pool(x, octree, depth, k), loop, features)


def test_pooling_over_channels_worked_by_hand() -> None:
    features = torch.tensor([[1.0, 5.0, 3.0], [-2.0, -4.0, 0.0]])
    assert octree_channel_pool(features).tolist() == [[5.0], [0.0]]
    assert octree_channel_pool(features, "average").tolist() == [[3.0], [-2.0]]


def test_equal_maxima_share_the_gradient_whatever_its_sign() -> None:
    """``segment_reduce`` of torch 2.13 shares positive gradients only."""
    codes = torch.full((2, 8), -1, dtype=torch.int16)
    codes[:, :3] = torch.tensor([8, 9, 15])  # three children of one octant; in both samples
    frames = OctreeFrame(codes=codes, features=torch.zeros(2, 8, 7, dtype=torch.float16), batch_size=[2])
    octree = Octree(frames, SPEC.depth)
    features = torch.tensor([[1.0], [1.0], [0.0], [2.0], [2.0], [2.0]], requires_grad=True)
    for pool in (octree_pool, octree_global_pool):
        (grad,) = torch.autograd.grad(pool(features, octree, 4), features, torch.tensor([[-1.0], [-3.0]]))
        assert grad[:, 0].tolist() == [-0.5, -0.5, 0.0, -1.0, -1.0, -1.0]


@pytest.mark.parametrize("node_set", NODE_SETS)
def test_joined_children_times_a_matrix_is_a_dense_convolution_of_kernel_and_stride_two(node_set: str) -> None:
    octree = make_octree(node_set)
    features = torch.randn(octree.level(4).nodes_n, 3, dtype=torch.float64)
    weight = torch.randn(8, 3, 5, dtype=torch.float64)

    def dense(features: Tensor, weight: Tensor) -> Tensor:
        grid = F.conv3d(octree_to_voxels(features, octree, 4), dense_weight(weight), stride=2)
        return at_nodes(grid, octree, 3)

    assert_same_values_and_gradients(
        lambda x, w: octree_join_children(x, octree, 4) @ w.flatten(0, 1), dense, features, weight
    )


@pytest.mark.parametrize("taps_about", ["self", "self, by layers", "first child"])
def test_gradients_of_the_gather_are_those_of_finite_differences(taps_about: str) -> None:
    octree = make_octree("occupied", batch_n=1, n=12)
    table, adjoint = in_one_part(octree.level(4).neighbours), None
    if taps_about == "self, by layers":
        table = octree.level(4).layered_neighbours
    if taps_about == "first child":
        table, adjoint = octree.strided_tables(4, 27)
    features = torch.randn(octree.level(4).nodes_n, 2, dtype=torch.float64, requires_grad=True)
    weight = torch.randn(27, 2, 2, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda x, w: GatherConv.apply(x, w, table, adjoint), (features, weight))
    assert torch.autograd.gradcheck(lambda w: GatherConv.apply(features.detach(), w, table, adjoint), (weight,))


def test_a_table_is_sorted_by_the_layers_that_its_rows_need() -> None:
    table = torch.full((4, 27), 4, dtype=torch.int32)  # 4 stands for nothing
    table[:, 13] = torch.arange(4)
    table[0, 26] = 1  # a node above, in the last layer
    table[1, 0] = 0  # and one below, in the first
    table[3, 9] = 2  # one beside
    parts = by_layers(table, 4)
    assert [(part.first_row, part.first_tap, *part.table.shape) for part in parts.parts] == [
        (0, 9, 2, 9),
        (2, 0, 1, 18),
        (3, 9, 1, 18),
    ]
    assert parts.in_parts(torch.tensor([[10], [11], [12], [13]])).tolist() == [[12], [13], [11], [10]]
    assert parts.in_order(torch.tensor([[12], [13], [11], [10]])).tolist() == [[10], [11], [12], [13]]
    for part in parts.parts:
        rows = parts.order[part.first_row : part.first_row + len(part.table)]
        assert torch.equal(part.table, table[rows, part.first_tap : part.first_tap + part.table.shape[1]])
        left_out = table[rows].clone()
        left_out[:, part.first_tap : part.first_tap + part.table.shape[1]] = 4
        assert (left_out == 4).all()


def test_turns_of_runs_worked_by_hand_and_empty_runs_give_zero() -> None:
    lengths = torch.tensor([1, 0, 3, 2])
    turns = Turns.of(lengths)
    assert [rows.tolist() for rows in turns.rows] == [[1, 4, 0], [2, 5], [3]]
    features = torch.tensor([[-1.0], [-2.0], [-4.0], [-3.0], [5.0], [6.0]])
    assert turns.reduce(features, "max").tolist() == [[-1.0], [0.0], [-2.0], [6.0]]
    assert turns.reduce(features, "sum").tolist() == [[-1.0], [0.0], [-9.0], [11.0]]
    assert Turns.of(lengths[:0]).reduce(features[:0], "max").shape == (0, 1)


@pytest.mark.parametrize("node_set", NODE_SETS)
def test_runs_in_turns_equal_runs_in_segments(node_set: str) -> None:
    octree = make_octree(node_set)
    runs = octree._siblings(4)
    features = torch.randn(octree.level(4).nodes_n, 5, dtype=torch.float64).round(decimals=1)  # with equal maxima
    coarse = torch.randn(octree.level(3).nodes_n, 5, dtype=torch.float64)
    in_segments = runs._replace(turns=None)
    assert_same_values_and_gradients(lambda x: runs.reduce(x, "max"), lambda x: in_segments.reduce(x, "max"), features)
    assert_same_values_and_gradients(runs.spread, in_segments.spread, coarse)


def test_the_adjoint_of_a_small_table_worked_by_hand() -> None:
    table = torch.tensor([[0, 3], [2, 0]], dtype=torch.int32)  # 2 outputs, 2 taps, 3 inputs; 3 reads nothing
    assert adjoint_table(table, 3).tolist() == [[0, 1], [2, 2], [1, 2]]


def test_chunks_do_not_change_the_result(monkeypatch: pytest.MonkeyPatch) -> None:
    octree = make_octree("occupied")
    features = torch.randn(octree.level(4).nodes_n, 3, requires_grad=True)
    conv = OctreeConv(3, 4)
    results = []
    for elements in (1_000, 1_000_000):
        monkeypatch.setitem(gather_conv_module._CHUNK_ELEMENTS, "cpu", elements)
        out = conv(features, octree, 4)
        results.append((out, *torch.autograd.grad(out.square().sum(), (features, conv.weight))))
    for a, b in zip(*results, strict=True):
        torch.testing.assert_close(a, b, rtol=1e-4, atol=1e-4)


def test_operators_run_under_autocast_and_keep_float32_weights() -> None:
    octree = make_octree("occupied")
    conv, up, pool = OctreeConv(7, 8, bias=True), OctreeDeconv(8, 4), OctreePool()
    with torch.autocast("cpu", dtype=torch.bfloat16):
        fine = conv(octree.node_features(), octree, 4)
        out = up(pool(fine, octree, 4), octree, 3)
    assert out.dtype == torch.bfloat16
    out.float().square().sum().backward()
    assert conv.weight.grad is not None
    assert conv.weight.grad.dtype == torch.float32
    reference = conv(octree.node_features(), octree, 4)
    torch.testing.assert_close(fine.float(), reference, rtol=0.03, atol=0.03)


@pytest.mark.parametrize("node_set", NODE_SETS)
@pytest.mark.parametrize("backend", ["sparse", "dense"])
def test_depths_that_an_octree_does_not_have_are_refused(node_set: str, backend: str) -> None:
    octree = Octree(random_frames(2), SPEC.depth, node_set, backend)
    weight = torch.ones(27, 7, 1)
    for depth in (-1, 5):
        with pytest.raises(ValueError, match=f"depth must be 0..4 in an octree of depth 4, got {depth}"):
            octree_conv(octree.node_features(), weight, octree, depth)
    with pytest.raises(ValueError, match="got 5"):
        octree_deconv(octree.node_features(), weight, octree, 4)
    with pytest.raises(ValueError, match="got -1"):
        octree_conv(torch.ones(octree.level(0).nodes_n, 7), weight, octree, 0, stride=2)


@pytest.mark.parametrize("dtype", [torch.float64, torch.float16, torch.int64])
def test_features_of_another_type_than_the_weight_are_refused(dtype: torch.dtype) -> None:
    octree = make_octree("occupied")
    features = octree.node_features().to(dtype)
    for layer in (OctreeConv(7, 4), OctreeConv(7, 4, kernel=1), OctreeConv(7, 4, stride=2)):
        with pytest.raises(ValueError, match=f"one dtype and device, got {dtype} on cpu and torch.float32 on cpu"):
            layer(features, octree, 4)


def test_weight_gradients_in_half_precision_add_up_in_float32(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(gather_conv_module._CHUNK_ELEMENTS, "cpu", 27)  # a row at a time
    octree = Octree(random_frames(8, n=500), SPEC.depth)
    features = torch.ones(octree.level(4).nodes_n, 1)
    weight = torch.ones(27, 1, 1, requires_grad=True)
    with torch.autocast("cpu", dtype=torch.bfloat16):
        octree_conv(features, weight, octree, 4).sum().backward()
    # bfloat16 has 8 bits: a sum of ones in it would stop at 256.
    assert octree.level(4).nodes_n > 1_000
    assert weight.grad is not None
    assert weight.grad[13].item() == pytest.approx(octree.level(4).nodes_n, rel=0.01)


@pytest.mark.parametrize("shapes", [((5, 7), (7, 40)), ((40, 7), (7, 5))])
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_products_equal_those_of_torch_and_take_transposed_views(shapes: tuple, dtype: torch.dtype) -> None:
    a, b = (torch.randn(shape, dtype=dtype) for shape in shapes)
    wide = torch.randn(len(a), 2 * b.shape[1], dtype=dtype)
    for left, right in ((a, b), (a.t().contiguous().t(), b), (a, b.t().contiguous().t())):
        out, total = torch.empty(len(a), b.shape[1], dtype=dtype), wide.clone()
        product(left, right, out=out)
        torch.testing.assert_close(out, a @ b)
        add_product(total[:, : b.shape[1]], left, right)
        torch.testing.assert_close(total[:, : b.shape[1]], wide[:, : b.shape[1]] + a @ b)
        assert torch.equal(total[:, b.shape[1] :], wide[:, b.shape[1] :])


@pytest.mark.parametrize("node_set", NODE_SETS)
def test_operators_pass_empty_octrees_through(node_set: str) -> None:
    octree = Octree(OctreeFrame.unoccupied(SPEC, (2,)), SPEC.depth, node_set)
    features = octree.node_features().requires_grad_()
    assert octree_join_children(features, octree, 4).shape == (octree.level(3).nodes_n, 56)
    out = OctreePool()(OctreeConv(7, 4)(features, octree, 4), octree, 4)
    assert out.shape == (0, 4)
    assert octree_upsample(out, octree, 3).shape == (0, 4)
    assert torch.equal(octree_global_pool(out, octree, 3), torch.zeros(2, 4))
    assert torch.equal(octree_global_pool(out, octree, 3, "average"), torch.zeros(2, 4))
    voxels = octree_to_voxels(octree_pool(out, octree, 3), octree, 2)
    assert torch.equal(voxels, torch.zeros(2, 4, 4, 4, 4))
    voxels.sum().backward()


def all_operators(octree: Octree, features: Tensor) -> list[Tensor]:
    torch.manual_seed(1)
    weight = torch.randn(27, features.shape[1], 4)
    down = octree_conv(features, weight, octree, 4, stride=2)
    return [
        octree_conv(features, weight, octree, 4),
        down,
        octree_deconv(down, torch.randn(27, 4, 4), octree, 3),
        octree_pool(features, octree, 4),
        octree_pool(features, octree, 4, "average"),
        octree_upsample(down, octree, 3),
        octree_join_children(features, octree, 4),
    ]


@pytest.mark.parametrize("node_set", NODE_SETS)
def test_a_batch_of_four_is_four_batches_of_one(node_set: str) -> None:
    frames = random_frames(4)
    frames.codes[2] = -1  # one of them sees nothing
    together = Octree(frames, SPEC.depth, node_set)
    alone = [Octree(frames[i : i + 1], SPEC.depth, node_set) for i in range(4)]
    merged = all_operators(together, together.node_features())
    single = [all_operators(octree, octree.node_features()) for octree in alone]
    for whole, parts in zip(merged, zip(*single, strict=True), strict=True):
        torch.testing.assert_close(whole, torch.cat(parts), rtol=1e-4, atol=1e-4)
    pooled = [octree_global_pool(o.node_features(), o, 4) for o in (together, *alone)]
    assert torch.equal(pooled[0], torch.cat(pooled[1:]))


@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a CUDA device")
def test_cuda_agrees_with_the_cpu() -> None:
    frames = random_frames(3)
    conv, down, up = OctreeConv(7, 8), OctreeConv(8, 8, stride=2), OctreeDeconv(8, 2)

    def run(device: str) -> Tensor:
        octree = Octree(frames.to(device), SPEC.depth)
        for module in (conv, down, up):
            module.to(device).zero_grad()
        x = down(conv(octree.node_features(), octree, 4), octree, 4)
        out = up(x + octree_pool(conv(octree.node_features(), octree, 4), octree, 4), octree, 3)
        out.square().sum().backward()
        return torch.cat([out.detach().flatten().cpu(), conv.weight.grad.flatten().cpu()])

    torch.testing.assert_close(run("cuda"), run("cpu"), rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize(("taps", "stride"), [(8, 1), (27, 3)])
def test_other_kernels_and_strides_are_refused(taps: int, stride: int) -> None:
    octree = make_octree("occupied")
    with pytest.raises(ConfigError, match="taps" if taps == 8 else "stride"):
        octree_conv(octree.node_features(), torch.zeros(taps, 7, 1), octree, 4, stride)


def test_an_unknown_pooling_is_refused() -> None:
    octree = make_octree("occupied")
    features = octree.node_features()
    for pool in (octree_pool, octree_global_pool):
        with pytest.raises(ConfigError, match="average"):
            pool(features, octree, 4, "mean")  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match="average"):
        octree_channel_pool(features, "mean")  # type: ignore[arg-type]


def test_features_of_another_depth_or_width_are_refused() -> None:
    octree = make_octree("occupied")
    features = octree.node_features()
    for operator in (octree_pool, octree_upsample, octree_global_pool, octree_to_voxels, octree_join_children):
        with pytest.raises(ValueError, match="nodes of depth 3"):
            operator(features, octree, 3)
    with pytest.raises(ValueError, match="nodes of depth 3"):
        octree_conv(features, torch.zeros(27, 7, 1), octree, 3)
    with pytest.raises(ConfigError, match=r"\(n, 4\) for this weight"):
        octree_conv(features, torch.zeros(27, 4, 1), octree, 4)
