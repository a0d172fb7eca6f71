"""Frames that an encoder is given, as the octree that it works on."""

from __future__ import annotations

import torch

from tr_grasp.octree import Backend, NodeSet, Octree, OctreeFrame, OctreeSpec


def merge_frames(
    frames: OctreeFrame, spec: OctreeSpec, node_set: NodeSet = "occupied", backend: Backend = "sparse"
) -> Octree:
    """The octree of frames ``(B,)`` that fit a spec.

    Raises:
        ValueError: If the frames have other channels, or leaves deeper than the spec's.
    """
    if frames.features.shape[-1] != spec.channels:
        raise ValueError(
            f"frames must have {spec.channels} channels, as the octree that the encoder was made for, "
            f"got {frames.features.shape[-1]}."
        )
    # A leaf too deep would count as one of the next sample's. A GPU would have to wait for the answer, and a graph that
    # is being traced has none.
    is_known = frames.codes.device.type == "cpu" and not torch.compiler.is_compiling()
    if is_known and frames.codes.numel() and int(frames.codes.max()) >= 8**spec.depth:
        raise ValueError(
            f"frames must have leaves of depth {spec.depth}, as the octree that the encoder was made for, "
            f"got Morton code {int(frames.codes.max())} of a deeper one."
        )
    return Octree(frames, spec.depth, node_set, backend)  # type: ignore[abstract]  # its __new__ makes a subclass
