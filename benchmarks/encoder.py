"""Speed of the encoders: ``python -m benchmarks.encoder``.

Prints JSON rows. Peers: the Vanilla O-CNN on dense grids with the same widths, and on ``ocnn`` if it is installed.
Collation is part of every time of ours; the peers' structures are made beforehand.
"""

from __future__ import annotations

import argparse

import numpy as np
import torch
from torch import Tensor, nn

from benchmarks import _ocnn
from benchmarks._common import SPEC, median_ms, print_row, tabletop_cloud, tabletop_frames
from tr_grasp.modules.encoders import build_encoder
from tr_grasp.octree import Octree, octree_to_voxels


class DensePeer(nn.Module):
    """Vanilla O-CNN of full grids."""

    def __init__(self) -> None:
        super().__init__()
        self.conv4 = nn.Conv3d(7, 32, 3, padding=1, bias=False)
        self.conv3 = nn.Conv3d(32, 64, 3, padding=1, bias=False)
        self.squeeze, self.head = nn.Conv3d(64, 16, 1), nn.Linear(1024, 160)

    def forward(self, grid: Tensor, masks: tuple[Tensor, Tensor]) -> Tensor:
        x = nn.functional.max_pool3d(self.conv4(grid).relu() * masks[0], 2)
        x = nn.functional.max_pool3d(self.conv3(x).relu() * masks[1], 2)
        return self.head(self.squeeze(x).relu().flatten(1)).relu()


def proprioception(batch_n: int) -> Tensor:
    tool = torch.tensor([1.0, *SPEC.centre_m, 1.0, 0.0, 0.0, 0.0, -1.0, 0.0])
    return tool + torch.randn(batch_n, 1, 10) * 0.01


def peers(batch_n: int) -> dict:
    """Name to call that returns features."""
    octree = Octree(tabletop_frames(batch_n), SPEC.depth)
    grid = octree_to_voxels(octree.leaf_features(), octree, 4).contiguous(memory_format=torch.channels_last_3d)
    masks = [octree_to_voxels(torch.ones(octree.level(d).nodes_n, 1), octree, d) for d in (4, 3)]
    dense = DensePeer().to(memory_format=torch.channels_last_3d)
    calls = {"dense Conv3d, channels last": lambda: dense(grid, masks)}
    ocnn = _ocnn.import_ocnn()
    if ocnn is not None:
        rng = np.random.default_rng(0)
        merged = _ocnn.merge(ocnn, [_ocnn.build_octree(ocnn, tabletop_cloud(rng), SPEC) for _ in range(batch_n)])
        for nempty, node_set in ((True, "occupied"), (False, "siblings")):
            peer = _ocnn.VanillaPeer(ocnn, nempty)
            calls[f"ocnn, {node_set}"] = lambda peer=peer: peer(merged)
    return calls


def bench(batch_n: int, repeats: int) -> None:
    frames, proprio = tabletop_frames(batch_n)[:, None], proprioception(batch_n)
    variants = {
        "vanilla_ocnn, occupied": build_encoder("vanilla_ocnn", stack_n=1),
        "vanilla_ocnn, siblings": build_encoder("vanilla_ocnn", stack_n=1, node_set="siblings"),
        "localising_ocnn": build_encoder("localising_ocnn", stack_n=1),
        "localising_ocnn, no convolution": build_encoder("localising_ocnn", stack_n=1, conv_layers_n=0),
    }
    ours = {name: lambda encoder=encoder: encoder(frames, proprio) for name, encoder in variants.items()}
    calls = ours | peers(batch_n)
    for what in ("forward", "forward + backward"):
        timed = [(no_grad if what == "forward" else with_backward)(call) for call in calls.values()]
        ms = dict(zip(calls, median_ms(*timed, repeats=repeats), strict=True))
        for name in ours:
            for peer in calls.keys() - ours.keys():
                print_row(f"{name}, {what}", ms[name], peer, ms[peer], batch=batch_n)


def no_grad(call):
    return torch.no_grad()(call)


def with_backward(call):
    return lambda: call().sum().backward()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--batch", type=int, default=32)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--repeats", type=int, default=9)
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    torch.manual_seed(0)
    bench(args.batch, args.repeats)


if __name__ == "__main__":
    main()
