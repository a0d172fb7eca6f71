"""Speed of the octree operators: ``python -m benchmarks.octree``.

Prints JSON rows. Peers: dense convolution of the same widths, and ``ocnn`` if it is installed.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from itertools import cycle
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from benchmarks import _ocnn
from benchmarks._common import SPEC, print_row, tabletop_cloud, tabletop_frames, timings
from tr_grasp.octree import (
    OctreeConv,
    OctreeFrame,
    SparseOctree,
    octree_from_points,
    octree_global_pool,
    octree_pool,
    octree_to_voxels,
    octree_upsample,
    octrees_from_clouds,
    random_elements,
    turn_frames,
)


def collate(frames: OctreeFrame, with_neighbours: bool = True) -> SparseOctree:
    """What an encoder builds before its first layer."""
    octree = SparseOctree(frames, SPEC.depth)
    octree.leaf_features()
    for depth in (SPEC.depth, SPEC.depth - 1):
        octree.children(depth - 1)
        if with_neighbours:
            _ = octree.level(depth).layered_neighbours
    return octree


def bench_build(batch_n: int) -> None:
    """Clouds to frames, against ocnn's octrees."""
    rng = np.random.default_rng(0)
    clouds = [tabletop_cloud(rng) for _ in range(batch_n)]
    ocnn = _ocnn.import_ocnn()
    ours_turn, peer_turn = cycle(clouds), cycle(clouds)  # another cloud each time, as in use
    calls = [lambda: octree_from_points(*next(ours_turn), SPEC)]
    if ocnn is not None:
        calls.append(lambda: _ocnn.build_octree(ocnn, next(peer_turn), SPEC))
    one = timings(*calls, repeats=10 * batch_n)
    print_row("points to stored octree, one cloud", one[0], "ocnn build", one[1] if ocnn is not None else None)

    def ours() -> OctreeFrame:
        return octrees_from_clouds(clouds, SPEC)

    if ocnn is None:
        print_row("points to stored octrees", *timings(ours), batch=batch_n)
        return

    def one_by_one() -> list[Any]:
        return [_ocnn.build_octree(ocnn, cloud, SPEC) for cloud in clouds]

    def at_once() -> Any:
        return _ocnn.build_octrees(ocnn, clouds, SPEC)

    stored, merged, *peers = timings(
        ours,
        lambda: collate(ours()),
        lambda: ocnn.octree.merge_octrees(one_by_one()),
        lambda: _ocnn.merge(ocnn, one_by_one()),
        at_once,
        lambda: at_once().construct_all_neigh(),
    )
    for way, (peer, with_neighbours) in (("build + merge", peers[:2]), ("build at once", peers[2:])):
        print_row("points to stored octrees", stored, f"ocnn {way}", peer, batch=batch_n)
        name = "points to merged octree with neighbours"
        print_row(name, merged, f"ocnn {way} + neighbours", with_neighbours, batch=batch_n)


def bench_structure(batch_n: int) -> None:
    """Frames to tables, and frames turned."""
    frames = tabletop_frames(batch_n)
    leaves_n = round(float(frames.leaves_n.float().mean()))
    elements = random_elements(batch_n)
    rows = {
        "collate, parents and children": lambda: collate(frames, with_neighbours=False),
        "collate, with neighbours of depths 4 and 3": lambda: collate(frames),
        "turn by a random symmetry": lambda: turn_frames(elements, frames, SPEC),
    }
    for (name, _), ms in zip(rows.items(), timings(*rows.values()), strict=True):
        print_row(name, ms, batch=batch_n, leaves=leaves_n)


def bench_operators(batch_n: int) -> None:
    """Single layers, against dense ones."""
    octree = collate(tabletop_frames(batch_n))
    for depth, inputs, outputs in ((4, 7, 32), (4, 32, 32), (3, 32, 64)):
        conv, dense = OctreeConv(inputs, outputs), nn.Conv3d(inputs, outputs, 3, padding=1, bias=False)
        x = torch.randn(octree.level(depth).nodes_n, inputs, requires_grad=inputs != 7)  # 7: the first layer
        grid = octree_to_voxels(x.detach(), octree, depth).requires_grad_(inputs != 7)
        ours_ms, peer_ms = timings(
            lambda conv=conv, x=x, depth=depth: conv(x, octree, depth).sum().backward(),
            lambda dense=dense, grid=grid: dense(grid).sum().backward(),
            repeats=9,
        )
        name = f"conv {inputs}->{outputs} at depth {depth}, forward + backward"
        print_row(name, ours_ms, "dense Conv3d", peer_ms, batch=batch_n)
    x = torch.randn(octree.level(4).nodes_n, 32, requires_grad=True)
    grid = octree_to_voxels(x.detach(), octree, 4).requires_grad_()
    coarse = torch.randn(octree.level(3).nodes_n, 32, requires_grad=True)
    coarse_grid = octree_to_voxels(coarse.detach(), octree, 3).requires_grad_()
    pairs: dict[str, tuple[Callable[[], Tensor], Callable[[], Tensor], str]] = {
        "max pool 32 at depth 4": (
            lambda: octree_pool(x, octree, 4),
            lambda: nn.functional.max_pool3d(grid, 2),
            "dense MaxPool3d",
        ),
        "upsample 32 from depth 3": (
            lambda: octree_upsample(coarse, octree, 3),
            lambda: nn.functional.interpolate(coarse_grid, scale_factor=2),
            "dense interpolate",
        ),
        "global max pool 32 at depth 4": (
            lambda: octree_global_pool(x, octree, 4),
            lambda: grid.amax((2, 3, 4)),
            "dense amax",
        ),
    }
    for name, (ours, dense, peer) in pairs.items():
        ours_ms, peer_ms = timings(with_backward(ours), with_backward(dense))
        print_row(f"{name}, forward + backward", ours_ms, peer, peer_ms, batch=batch_n)


def with_backward(call: Callable[[], Tensor]) -> Callable[[], None]:
    """The call, then its gradients."""
    return lambda: call().sum().backward()


def main() -> None:
    """Read the flags and run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--batch", type=int, default=32)
    parser.add_argument("--threads", type=int, default=1)
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    torch.manual_seed(0)
    bench_build(args.batch)
    bench_structure(args.batch)
    bench_operators(args.batch)


if __name__ == "__main__":
    main()
