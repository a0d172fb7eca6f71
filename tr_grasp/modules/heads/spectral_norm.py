"""Spectral normalisation that survives functional parameters, copies and pickling."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from tr_grasp.octree import OctreeConv, OctreeDeconv

WARM_UP_ITERATIONS = 15


class SpectralNorm(nn.Module):
    """A layer whose weight is divided by its largest singular value, so that it stretches no vector.

    The singular value is ``u W v`` with vectors that one power iteration a training pass moves; in evaluation they
    stand still. Gradients flow through the division, not through the vectors. A target network has vectors of its own:
    its passes fit them to its own weights, and no update of targets needs to know about them.

    ``torch.nn.utils.parametrizations.spectral_norm`` does the same arithmetic, but its modules cannot be pickled, which
    sending a policy to collecting processes takes; those of the older ``torch.nn.utils.spectral_norm`` cannot be copied
    once they were used.

    Args:
        layer: Anything with a ``weight`` of two or more dimensions, of which the last one is kept and the others are
            taken together: ``(out, in)`` of a linear layer, ``(taps * in, out)`` of an octree convolution.

    Source: Miyato et al. 2018, arXiv:1802.05957.
    """

    layer: Any
    u: Tensor
    v: Tensor

    def __init__(self, layer: nn.Module) -> None:
        super().__init__()
        self.layer = layer
        rows, columns = self._matrix().shape
        self.register_buffer("u", F.normalize(torch.randn(rows), dim=0))
        self.register_buffer("v", F.normalize(torch.randn(columns), dim=0))
        for _ in range(WARM_UP_ITERATIONS):
            self._iterate()

    @property
    def weight(self) -> Tensor:
        """The layer's weight after the division."""
        # Copies, because later passes move the buffers in place while this pass' graph still needs them.
        u, v = self.u.clone(), self.v.clone()
        return self.layer.weight / torch.dot(u, self._matrix() @ v)

    def forward(self, *inputs: object) -> Tensor:
        """What the layer makes of its inputs with the divided weight."""
        if self.training:
            self._iterate()
        # An instance's own entry hides parameters and buffers, and is also where functional parameters may lie;
        # torch.func.functional_call refuses to replace those.
        own = vars(self.layer)
        before = {"weight": own["weight"]} if "weight" in own else {}
        own["weight"] = self.weight
        try:
            return self.layer(*inputs)
        finally:
            del own["weight"]
            own.update(before)

    def __getattr__(self, name: str) -> Any:
        """Whatever else is asked of it, its layer answers."""
        try:
            return super().__getattr__(name)
        except AttributeError:
            return getattr(super().__getattr__("layer"), name)

    def _matrix(self) -> Tensor:
        return self.layer.weight.flatten(0, -2)

    @torch.no_grad()
    def _iterate(self) -> None:
        matrix = self._matrix()
        self.v.copy_(F.normalize(matrix.T @ self.u, dim=0))
        self.u.copy_(F.normalize(matrix @ self.v, dim=0))


def normalise_kernels(module: nn.Module) -> None:
    """Put every linear layer and octree convolution inside a module into a :class:`SpectralNorm`, in place."""
    for name, child in module.named_children():
        if isinstance(child, nn.Linear | OctreeConv | OctreeDeconv):
            setattr(module, name, SpectralNorm(child))
        elif not isinstance(child, SpectralNorm):
            normalise_kernels(child)
