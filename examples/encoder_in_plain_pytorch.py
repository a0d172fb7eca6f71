"""An octree encoder in an ordinary PyTorch loop: where is the ball in this point cloud?"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from tr_grasp.modules import VanillaOCNN
from tr_grasp.octree import OctreeFrame, OctreeSpec, octrees_from_clouds

SPEC = OctreeSpec(origin_m=(0.0, 0.0, 0.0), side_m=0.24, colour=False)
RADIUS_M = 0.03


def balls(n: int, generator: torch.Generator) -> tuple[OctreeFrame, Tensor]:
    """``n`` octrees of points on a ball, and the balls' centres ``(n, 3)`` [m]."""
    centres = RADIUS_M + torch.rand(n, 3, generator=generator) * (SPEC.side_m - 2 * RADIUS_M)
    normals = nn.functional.normalize(torch.randn(n, 300, 3, generator=generator), dim=2)
    points = centres[:, None] + RADIUS_M * normals
    return octrees_from_clouds([(*cloud, None) for cloud in zip(points, normals, strict=True)], SPEC), centres


class BallFinder(nn.Module):
    """Encoder and a linear layer; without proprioception the encoder's second argument is not looked at."""

    def __init__(self) -> None:
        super().__init__()
        self.encoder = VanillaOCNN(SPEC, proprio=False)
        self.head = nn.Linear(self.encoder.features_n, 3)

    def forward(self, frames: OctreeFrame) -> Tensor:
        """Centres ``(n, 3)`` [m] of frames ``(n,)``."""
        return SPEC.side_m * self.head(self.encoder(frames, torch.zeros(len(frames), 10)))


def main(updates: int = 60) -> tuple[float, float]:
    """Mean error [m] on balls that were never seen, before and after learning."""
    generator = torch.Generator().manual_seed(0)
    torch.manual_seed(0)
    network, unseen = BallFinder(), balls(64, generator)
    optimiser = torch.optim.Adam(network.parameters(), lr=1e-3)

    def error(frames: OctreeFrame, centres: Tensor) -> Tensor:
        return (network(frames) - centres).norm(dim=1).mean()

    before = error(*unseen).item()
    for _ in range(updates):
        optimiser.zero_grad()
        error(*balls(32, generator)).backward()
        optimiser.step()
    return before, error(*unseen).item()


if __name__ == "__main__":
    print("error before {:.3f} m, after {:.3f} m".format(*main()))
