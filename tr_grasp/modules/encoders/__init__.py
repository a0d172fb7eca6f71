"""Encoders: stacked octree frames and proprioception to features."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from torch import nn

from tr_grasp.configs import WorkspaceCfg
from tr_grasp.errors import ConfigError, unknown_name
from tr_grasp.modules.encoders.localising import LocalisingOCNN
from tr_grasp.modules.encoders.stacked import StackedEncoder
from tr_grasp.modules.encoders.vanilla import VanillaOCNN
from tr_grasp.octree import NodeSet, OctreeSpec

__all__ = ["ENCODERS", "LocalisingOCNN", "StackedEncoder", "VanillaOCNN", "build_encoder"]

ENCODERS = ("localising_ocnn", "vanilla_ocnn")


def build_encoder(
    name: str,
    *,
    in_channels: int = 7,
    stack_n: int = 3,
    shared_stack: bool = False,
    node_set: NodeSet = "occupied",
    spec: OctreeSpec | None = None,
    features_n: int = 128,
    conv_layers_n: int = 1,
) -> StackedEncoder:
    """The encoder of that name for stacked observations.

    Args:
        name: ``vanilla_ocnn`` or ``localising_ocnn``.
        in_channels: Channels of a leaf: 7, or 4 without colour.
        stack_n: Stacked observations.
        shared_stack: One encoder for all stacked observations; ``localising_ocnn`` always shares.
        node_set: Octants that ``vanilla_ocnn`` convolves on: ``occupied`` or ``siblings``.
        spec: The frames' octree; by default depth 4 over the standard workspace.
        features_n: Features of a frame of ``localising_ocnn``.
        conv_layers_n: Convolutions of ``localising_ocnn``.

    Returns:
        A module of frames ``(B, stack)`` and proprioception ``(B, stack, 10)``, with an attribute ``features_n``.

    Raises:
        ConfigError: For an unknown name, or ``in_channels`` that the spec does not have.
    """
    spec = spec or default_spec(colour=in_channels == 7)
    if spec.channels != in_channels:
        raise ConfigError(f"in_channels must be {spec.channels}, the channels of the octree, got {in_channels}.")
    make: Callable[[], nn.Module]
    if name == "vanilla_ocnn":
        make = partial(VanillaOCNN, spec, node_set)
    elif name == "localising_ocnn":
        make, shared_stack = partial(LocalisingOCNN, spec, features_n, conv_layers_n), True
    else:
        raise ConfigError(unknown_name("encoder", name, ENCODERS))
    return StackedEncoder(make, stack_n, shared_stack)


def default_spec(colour: bool = True) -> OctreeSpec:
    """Depth 4 over the cube of the standard workspace."""
    workspace = WorkspaceCfg()
    x, y, z = (c - workspace.side_m / 2 for c in workspace.centre_m)
    return OctreeSpec((x, y, z), workspace.side_m, colour=colour)
