"""The twin of a policy whose graph does not depend on what it sees."""

from __future__ import annotations

import copy
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from tr_grasp.errors import ExportError
from tr_grasp.modules.agent import Agent
from tr_grasp.modules.encoders import ENCODERS


class DensePolicy(nn.Module):
    """Encoder and actor with an agent's weights, the encoder on the dense backend of ``tr_grasp.octree``.

    It acts as ``agent.policy`` does without exploration, to rounding.

    Args:
        agent: Stays as it is; its weights are copied.

    Raises:
        ExportError: If its encoder has no dense backend.
    """

    def __init__(self, agent: Agent) -> None:
        super().__init__()
        self.env_spec = agent.env_spec
        self.encoder = copy.deepcopy(agent.encoder.module.encoder)
        self.actor = copy.deepcopy(agent.actor.module[0].module)
        for encoder in self.encoder.encoders:
            _make_dense(encoder)
        self.eval().requires_grad_(False)

    def forward(self, codes: Tensor, features: Tensor, proprio: Tensor) -> Tensor:
        """The deterministic action, float32 ``(B, action_n)`` in [-1, 1].

        Args:
            codes: ``(B, stack, leaf_capacity)``, as of ``OctreeFrame``.
            features: ``(B, stack, leaf_capacity, channels)``, as of ``OctreeFrame``.
            proprio: float32 ``(B, stack, proprio_n)``.
        """
        return torch.tanh(self.actor.mean(self.encoder(_Frames(codes, features), proprio)))


def exportable_encoders() -> list[str]:
    """Names of the encoders with a dense backend."""
    return sorted(name for name, encoder in ENCODERS.items() if hasattr(encoder, "backend"))


@dataclass(frozen=True)
class _Frames:
    """What encoders ask of an ``OctreeFrame``, which itself would fix the batch size of the traced graph."""

    codes: Tensor
    features: Tensor

    @property
    def batch_size(self) -> torch.Size:
        return self.codes.shape[:-1]

    def flatten(self, start: int, end: int) -> _Frames:
        return _Frames(self.codes.flatten(start, end), self.features.flatten(start, end))

    def __getitem__(self, index: tuple[slice, int]) -> _Frames:
        return _Frames(self.codes[index], self.features[index])


def _make_dense(encoder: nn.Module) -> None:
    if not hasattr(encoder, "backend"):
        names = {made: name for name, made in ENCODERS.items()}
        raise ExportError(
            f"encoder {names.get(type(encoder), type(encoder).__name__)} cannot be exported, for it has no dense "
            f"backend; those that can: {', '.join(exportable_encoders())}."
        )
    encoder.backend = "dense"  # type: ignore[assignment]
