"""What a depth camera saw, as an observation."""

from __future__ import annotations

import numpy as np
import torch

from tr_grasp.sensing import DepthImage


def picture_tensors(image: DepthImage) -> tuple[torch.Tensor, torch.Tensor]:
    """Colour uint8 (3, h, w) and depth float32 (1, h, w) [m], 0 where nothing was seen."""
    colour = np.round(255 * np.clip(image.colour, 0, 1)).astype(np.uint8)
    depth = np.where(np.isfinite(image.depth), image.depth, 0.0).astype(np.float32)
    return torch.from_numpy(np.ascontiguousarray(np.moveaxis(colour, -1, 0))), torch.from_numpy(depth[None])
