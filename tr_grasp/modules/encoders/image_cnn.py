"""A baseline that sees an RGB-D image instead of an octree."""

from __future__ import annotations

from itertools import pairwise

import torch
from torch import Tensor, nn

from tr_grasp.modules.encoders.grid import PROPRIO_N


def rgbd_image(colour_image: Tensor, depth_image: Tensor) -> Tensor:
    """float32 ``(*batch, 4, H, W)`` of the pictures that an environment with ``observation.image`` gives.

    Args:
        colour_image: uint8 ``(*batch, 3, H, W)``.
        depth_image: float32 ``(*batch, 1, H, W)`` [m], or float16 as a replay keeps it.
    """
    return torch.cat([colour_image.float() / 255, depth_image.float()], dim=-3)


class ImageCNN(nn.Module):
    """Strided 3 x 3 convolutions, the mean over each cell of a 4 x 4 grid, and a fully connected layer.

    Works on images of any size from 16 x 16. As ``StackedEncoder`` hands on what it is given, it stacks images as it
    stacks frames.

    Args:
        image_channels: 4 for RGB-D, 3 for RGB, 1 for depth.
        features_n: Features of an image.
        proprio: Append features of the proprioception, 10 of the ``features_n``.
    """

    widths = (32, 64, 64, 64)
    grid_side = 4

    def __init__(self, image_channels: int = 4, features_n: int = 128, proprio: bool = True) -> None:
        super().__init__()
        self.features_n = features_n
        proprio_n = PROPRIO_N if proprio else 0
        layers = [
            nn.Sequential(nn.Conv2d(a, b, 3, stride=2, padding=1), nn.ReLU())
            for a, b in pairwise((image_channels, *self.widths))
        ]
        self.convs = nn.Sequential(*layers, nn.AdaptiveAvgPool2d(self.grid_side), nn.Flatten())
        self.image_head = nn.Linear(self.widths[-1] * self.grid_side**2, features_n - proprio_n)
        self.proprio_head = nn.Linear(PROPRIO_N, PROPRIO_N) if proprio else None

    def forward(self, image: Tensor, proprio: Tensor) -> Tensor:
        """Features ``(B, features_n)`` of images and proprioception ``(B, 10)``.

        Args:
            image: float32 ``(B, image_channels, H, W)``: rgb in [0, 1], depth [m], 0 where there is none.
            proprio: As in every observation.
        """
        features = self.image_head(self.convs(image))
        if self.proprio_head is not None:
            features = torch.cat([features, self.proprio_head(proprio)], dim=1)
        return features.relu()
