"""A baseline that sees no octree."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from tr_grasp.modules.encoders.tool_frame import TOOL_FEATURES_N, tool_pose
from tr_grasp.octree import OctreeFrame, OctreeSpec


class StateMLP(nn.Module):
    """An MLP of the proprioception, and of a privileged state if there is one.

    Without a state it is blind: what it reaches is what a policy reaches by knowing the task alone.

    Args:
        spec: The octree, whose cube the tool's position is measured in.
        features_n: Features of a frame.
        state_n: Length of the privileged state.
    """

    hidden_n = 256

    def __init__(self, spec: OctreeSpec, features_n: int = 128, state_n: int = 0) -> None:
        super().__init__()
        self.spec = spec
        self.features_n = features_n
        self.state_n = state_n
        self.mlp = nn.Sequential(
            nn.Linear(TOOL_FEATURES_N + state_n, self.hidden_n),
            nn.ReLU(),
            nn.Linear(self.hidden_n, features_n),
            nn.ReLU(),
        )

    def forward(self, state: Tensor | OctreeFrame, proprio: Tensor) -> Tensor:
        """Features ``(B, features_n)`` of states ``(B, state_n)`` and proprioception ``(B, 10)``.

        With ``state_n = 0`` the first argument is not looked at and may be frames.
        """
        seen = [tool_pose(proprio, self.spec).features]
        if self.state_n:
            seen.append(state)  # type: ignore[arg-type]
        return self.mlp(torch.cat(seen, dim=1))
