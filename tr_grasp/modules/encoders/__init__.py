"""Encoders: stacked octree frames and proprioception to features."""

from __future__ import annotations

import inspect
from functools import partial
from typing import Any

from torch import nn

from tr_grasp.configs import WorkspaceCfg
from tr_grasp.errors import ConfigError, unknown_name
from tr_grasp.modules.encoders.ahrnet import OAHRNet
from tr_grasp.modules.encoders.attention import OctreeAttention
from tr_grasp.modules.encoders.frames import shared_octrees
from tr_grasp.modules.encoders.image_cnn import ImageCNN, rgbd_image
from tr_grasp.modules.encoders.localising import LocalisingOCNN
from tr_grasp.modules.encoders.norm import copy_statistics
from tr_grasp.modules.encoders.point_net import PointNet
from tr_grasp.modules.encoders.residual import ResidualOCNN
from tr_grasp.modules.encoders.stacked import StackedEncoder
from tr_grasp.modules.encoders.state_mlp import StateMLP
from tr_grasp.modules.encoders.vanilla import VanillaOCNN
from tr_grasp.octree import OctreeSpec

__all__ = [
    "ENCODERS",
    "ImageCNN",
    "LocalisingOCNN",
    "OAHRNet",
    "OctreeAttention",
    "PointNet",
    "ResidualOCNN",
    "StackedEncoder",
    "StateMLP",
    "VanillaOCNN",
    "build_encoder",
    "copy_statistics",
    "default_spec",
    "encoder_options",
    "rgbd_image",
    "shared_octrees",
]

ENCODERS: dict[str, type[nn.Module]] = {
    "vanilla_ocnn": VanillaOCNN,
    "residual_ocnn": ResidualOCNN,
    "o_ahrnet": OAHRNet,
    "localising_ocnn": LocalisingOCNN,
    "point_net": PointNet,
    "state_mlp": StateMLP,
    "image_cnn": ImageCNN,
}
"""Name to network. All but ``image_cnn`` read octree frames and are made of an ``OctreeSpec`` and options."""


def build_encoder(
    name: str,
    *,
    in_channels: int = 7,
    stack_n: int = 3,
    shared_stack: bool = False,
    spec: OctreeSpec | None = None,
    **options: Any,
) -> StackedEncoder:
    """The encoder of that name for stacked observations.

    Args:
        name: One of ``ENCODERS``. ``image_cnn`` knows of no octree: it ignores ``in_channels`` and ``spec``.
        in_channels: Channels of a leaf: 7, or 4 without colour.
        stack_n: Stacked observations.
        shared_stack: One encoder for all stacked observations; ``localising_ocnn`` always shares.
        spec: The frames' octree; by default depth 4 over the standard workspace.
        options: Keyword arguments of the network's class, such as ``node_set``, ``num_blocks``, ``norm``, ``proprio``
            or ``features_n``; see :func:`encoder_options`. An option of other networks may be given with its default
            value, so that settings with a field for every option can be handed on whole.

    Returns:
        A module of frames ``(B, stack)``, or of pictures ``(B, stack, 4, H, W)`` as of :func:`rgbd_image`, and of
        proprioception ``(B, stack, 10)``, with an attribute ``features_n``.

    Raises:
        ConfigError: For an unknown name, an option that the network does not have, a value that it refuses, or
            ``in_channels`` that the spec does not have.
    """
    if name not in ENCODERS:
        raise ConfigError(unknown_name("encoder", name, ENCODERS))
    own = _own_options(name, options)
    if name == "image_cnn":
        return StackedEncoder(partial(ImageCNN, **own), stack_n, shared_stack)
    spec = spec or default_spec(colour=in_channels == 7)
    if spec.channels != in_channels:
        raise ConfigError(f"in_channels must be {spec.channels}, the channels of the octree, got {in_channels}.")
    make = partial(ENCODERS[name], spec, **own)
    return StackedEncoder(make, stack_n, shared_stack or name == "localising_ocnn")


def encoder_options(name: str) -> dict[str, Any]:
    """The options of an encoder and their defaults."""
    parameters = inspect.signature(ENCODERS[name]).parameters
    return {key: parameter.default for key, parameter in parameters.items() if parameter.default is not parameter.empty}


def default_spec(colour: bool = True) -> OctreeSpec:
    """Depth 4 over the cube of the standard workspace."""
    workspace = WorkspaceCfg()
    x, y, z = (c - workspace.side_m / 2 for c in workspace.centre_m)
    return OctreeSpec((x, y, z), workspace.side_m, colour=colour)


def _own_options(name: str, options: dict[str, Any]) -> dict[str, Any]:
    """Those that the network has; the others are refused unless they change nothing."""
    own = encoder_options(name)
    defaults = {key: value for other in ENCODERS for key, value in encoder_options(other).items()}
    for key, value in options.items():
        if key not in own and (key not in defaults or value != defaults[key]):
            raise ConfigError(f"{name} has no option {key!r} (given {value!r}). Valid: {', '.join(sorted(own))}.")
    return {key: value for key, value in options.items() if key in own}
