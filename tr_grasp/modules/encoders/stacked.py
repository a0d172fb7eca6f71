"""One encoder for each stacked observation, or one for all."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor, nn

from tr_grasp.octree import OctreeFrame


class StackedEncoder(nn.Module):
    """Encode each observation of a stack and put the features side by side, oldest first.

    Args:
        make_frame_encoder: Makes an encoder of ``frames (B,)`` (or of images or states, whatever the stack holds) and
            ``proprio (B, 10)`` that has ``features_n``.
        stack_n: Observations in a stack.
        shared: One encoder for all, which then sees all frames as one batch; otherwise one with its own weights for
            each place in the stack (thesis). A frame's features do not depend on its place then, but frames that
            occur twice in a batch are not looked for: they are rare.
    """

    def __init__(self, make_frame_encoder: Callable[[], nn.Module], stack_n: int, shared: bool) -> None:
        super().__init__()
        self.stack_n = stack_n
        self.shared = shared
        self.encoders = nn.ModuleList(make_frame_encoder() for _ in range(1 if shared else stack_n))
        self.features_n: int = stack_n * self.encoders[0].features_n  # type: ignore[assignment, operator]

    def forward(self, frames: OctreeFrame | Tensor, proprio: Tensor) -> Tensor:
        """Features ``(B, features_n)`` of frames with batch size ``(B, stack)`` and proprio ``(B, stack, 10)``.

        Raises:
            ValueError: If the stack has another length.
        """
        batch = tuple(frames.shape[:2]) if isinstance(frames, Tensor) else tuple(frames.batch_size)
        if batch[1:] != (self.stack_n,):
            raise ValueError(f"frames must have batch size (B, {self.stack_n}), got {batch}.")
        if self.shared:
            return self.encoders[0](frames.flatten(0, 1), proprio.flatten(0, 1)).view(proprio.shape[0], -1)
        features = [encoder(frames[:, t], proprio[:, t]) for t, encoder in enumerate(self.encoders)]
        return torch.cat(features, dim=1)
