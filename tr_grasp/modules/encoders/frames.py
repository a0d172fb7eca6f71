"""Frames that an encoder is given, as the octree that it works on."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

import torch
from torch import Tensor

from tr_grasp.octree import Backend, NodeSet, Octree, OctreeFrame, OctreeSpec

Made = list[tuple[OctreeFrame, tuple[OctreeSpec, NodeSet, Backend], Octree]]

_made: ContextVar[Made | None] = ContextVar("octrees made so far", default=None)


@contextmanager
def shared_octrees() -> Iterator[None]:
    """Within it, encoders that are given equal frames work on one octree, whose tables are made once.

    An update sees most frames more than once: online and target encoders both look at o', and what is the newest
    observation of o is the last but one of o'. Frames must not be written to meanwhile. Only frames on the CPU are
    compared: elsewhere that would wait for the device.
    """
    token = _made.set([])
    try:
        yield
    finally:
        _made.reset(token)


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
    made = _made.get() if is_known else None
    if made is None:
        return Octree(frames, spec.depth, node_set, backend)  # type: ignore[abstract]  # its __new__ makes a subclass
    settings = (spec, node_set, backend)
    for known, known_settings, octree in made:
        if known_settings == settings and _are_equal(known, frames):
            return octree
    octree = Octree(frames, spec.depth, node_set, backend)  # type: ignore[abstract]
    made.append((frames, settings, octree))
    return octree


def _are_equal(a: OctreeFrame, b: OctreeFrame) -> bool:
    pairs = ((a.codes, b.codes), (a.features, b.features))
    return all(_are_same(x, y) for x, y in pairs) or all(torch.equal(_bits(x), _bits(y)) for x, y in pairs)


def _are_same(a: Tensor, b: Tensor) -> bool:
    """Whether they are views of the same memory, which saves reading it."""
    return a.data_ptr() == b.data_ptr() and a.shape == b.shape and a.stride() == b.stride() and a.dtype == b.dtype


def _bits(values: Tensor) -> Tensor:
    # Halves are slow to compare on a CPU, and numbers that differ in their bits alone may have an octree each.
    return values.view(torch.int16) if values.dtype == torch.float16 else values
