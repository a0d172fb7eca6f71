"""Speed of the encoders: ``python -m benchmarks.encoder``.

Prints JSON rows of time and of peak memory. Peers: the Vanilla O-CNN on dense grids with the same widths, and the
networks of the thesis on ``ocnn`` if it is installed. From stored frames to features: collation is part of every time,
also of ocnn's (merge and neighbour tables), but not of the dense peer's, which is handed its grid. "dense backend" is
the exportable twin.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import partial

import numpy as np
import torch
from torch import Tensor, nn

from benchmarks import _ocnn
from benchmarks._common import (
    SPEC,
    peak_mib,
    print_memory_row,
    print_row,
    tabletop_cloud,
    tabletop_frames,
    timings,
)
from tr_grasp.modules.encoders import build_encoder
from tr_grasp.octree import Backend, Octree, OctreeConv, OctreeFrame, OctreePool, octree_to_voxels

Call = Callable[[], Tensor]
DENSE = "Vanilla on dense Conv3d, channels last"
OCNN = "{} on ocnn, {}"


class DensePeer(nn.Module):
    """Vanilla O-CNN of full grids."""

    def __init__(self) -> None:
        super().__init__()
        self.conv4 = nn.Conv3d(7, 32, 3, padding=1, bias=False)
        self.conv3 = nn.Conv3d(32, 64, 3, padding=1, bias=False)
        self.squeeze, self.head = nn.Conv3d(64, 16, 1), nn.Linear(1024, 160)

    def forward(self, grid: Tensor, masks: list[Tensor]) -> Tensor:
        """Features ``(B, 160)``."""
        x = nn.functional.max_pool3d(self.conv4(grid).relu() * masks[0], 2)
        x = nn.functional.max_pool3d(self.conv3(x).relu() * masks[1], 2)
        return self.head(self.squeeze(x).relu().flatten(1)).relu()


class OnBackend(nn.Module):
    """Vanilla O-CNN on our operators and either backend, with the gradients of the same weights."""

    def __init__(self, backend: Backend) -> None:
        super().__init__()
        self.backend: Backend = backend
        self.conv4, self.conv3, self.pool = OctreeConv(7, 32), OctreeConv(32, 64), OctreePool()
        self.squeeze, self.head = nn.Linear(64, 16), nn.Linear(1024, 160)

    def forward(self, frames: OctreeFrame) -> Tensor:
        """Features ``(B, 160)``."""
        octree = Octree(frames, SPEC.depth, backend=self.backend)
        x = self.pool(self.conv4(octree.node_features(), octree, 4), octree, 4).relu()
        x = self.pool(self.conv3(x, octree, 3), octree, 3).relu()
        voxels = octree_to_voxels(x, octree, 2).permute(0, 2, 3, 4, 1)
        return self.head(self.squeeze(voxels).relu().flatten(1)).relu()


def our_calls(batch_n: int) -> dict[str, Call]:
    """Name of the encoder to a call that returns features."""
    frames = tabletop_frames(batch_n)[:, None]
    tool = torch.tensor([1.0, *SPEC.centre_m, 1.0, 0.0, 0.0, 0.0, -1.0, 0.0])
    proprio = tool + torch.randn(batch_n, 1, 10) * 0.01
    encoders = {
        "vanilla_ocnn, occupied": build_encoder("vanilla_ocnn", stack_n=1),
        "vanilla_ocnn, siblings": build_encoder("vanilla_ocnn", stack_n=1, node_set="siblings"),
        "localising_ocnn": build_encoder("localising_ocnn", stack_n=1),
        "localising_ocnn, no convolution": build_encoder("localising_ocnn", stack_n=1, conv_layers_n=0),
        "residual_ocnn, occupied": build_encoder("residual_ocnn", stack_n=1),
        "o_ahrnet, occupied": build_encoder("o_ahrnet", stack_n=1),
    }
    calls: dict[str, Call] = {name: partial(encoder, frames, proprio) for name, encoder in encoders.items()}
    return calls | {"vanilla_ocnn, dense backend": partial(OnBackend("dense"), frames[:, 0])}


def peer_calls(batch_n: int) -> dict[str, Call]:
    """Name of the peer to a call that returns features."""
    octree = Octree(tabletop_frames(batch_n), SPEC.depth)
    grid = octree_to_voxels(octree.leaf_features(), octree, 4).contiguous(memory_format=torch.channels_last_3d)
    masks = [octree_to_voxels(torch.ones(octree.level(d).nodes_n, 1), octree, d) for d in (4, 3)]
    calls: dict[str, Call] = {DENSE: partial(DensePeer().to(memory_format=torch.channels_last_3d), grid, masks)}
    ocnn = _ocnn.import_ocnn()
    if ocnn is not None:
        rng = np.random.default_rng(0)
        octrees = [_ocnn.build_octree(ocnn, tabletop_cloud(rng), SPEC) for _ in range(batch_n)]
        for node_set in ("occupied", "siblings"):
            peer = _ocnn.VanillaPeer(ocnn, nempty=node_set == "occupied")
            calls[OCNN.format("vanilla_ocnn", node_set)] = lambda peer=peer: peer(_ocnn.merge(ocnn, octrees))
        for name in ("residual_ocnn", "o_ahrnet"):
            peer = _ocnn.EncoderPeer(ocnn, name, SPEC, nempty=True)
            calls[OCNN.format(name, "occupied")] = lambda peer=peer: peer(_ocnn.merge(ocnn, octrees))
    return calls


def bench(batch_n: int, repeats: int) -> None:
    """Time everything in turns and print each encoder beside its peers."""
    ours, peers = our_calls(batch_n), peer_calls(batch_n)
    calls = ours | peers
    for what, prepare in {"forward": torch.no_grad(), "forward + backward": with_backward}.items():
        prepared = {name: prepare(call) for name, call in calls.items()}
        ms = dict(zip(calls, timings(*prepared.values(), repeats=repeats), strict=True))
        mib = {name: peak_mib(call) for name, call in prepared.items()}
        for name in ours:
            for peer in peers_of(name) & peers.keys() or {None}:
                print_row(f"{name}, {what}", ms[name], peer, ms.get(peer), batch=batch_n)
                print_memory_row(f"{name}, {what}, peak memory", mib[name], peer, mib.get(peer), batch=batch_n)


def peers_of(name: str) -> set[str]:
    """The same network on ocnn; for small networks also the dense one and Vanilla on ocnn."""
    network, node_set = name.split(",")[0], "siblings" if "siblings" in name else "occupied"
    if network in ("residual_ocnn", "o_ahrnet"):
        return {OCNN.format(network, node_set)}
    return {DENSE, OCNN.format("vanilla_ocnn", node_set)}


def with_backward(call: Call) -> Callable[[], None]:
    """The call, then its gradients."""
    return lambda: call().sum().backward()


def main() -> None:
    """Read the flags and run."""
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
