"""Forward kinematics and Jacobians of many joint vectors at once: products of constant transforms and turns about z."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tr_grasp.motion.arguments import Array


@dataclass(frozen=True, eq=False)
class Chain:
    """Revolute joints in a row, each axis the z of its own frame.

    ``T_base_tcp = fixed[0] · Rz(q₁) · fixed[1] · … · Rz(q_n) · fixed[n]``

    Attributes:
        fixed: (n + 1, 4, 4) constant transforms between the joints.
    """

    fixed: Array

    @property
    def dof(self) -> int:
        """Number of joints."""
        return len(self.fixed) - 1

    @classmethod
    def from_axes(cls, placements: Array, axes: Array, T_last_tcp: Array) -> Chain:
        """From joint frames (n, 4, 4), each in the one before, their unit axes (n, 3), and the tool."""
        turns = [_turn_z_to(axis) for axis in axes]
        fixed = [placements[0] @ turns[0]]
        for before, placement, after in zip(turns[:-1], placements[1:], turns[1:], strict=True):
            fixed.append(before.T @ placement @ after)
        return cls(np.array([*fixed, turns[-1].T @ T_last_tcp]))

    def pose(self, q: Array) -> Array:
        """``T_base_tcp`` (b, 4, 4) of joints (b, n)."""
        rows, _ = self._walk(q, keep=False)
        T = np.zeros((len(q), 4, 4))
        T[:, :3], T[:, 3, 3] = rows, 1.0
        return T

    def pose_and_jacobian(self, q: Array) -> tuple[Array, Array]:
        """``T_base_tcp`` (b, 4, 4), and its Jacobian (b, 6, n): linear over angular, at the tcp, base axes."""
        rows, frames = self._walk(q, keep=True)
        T = np.zeros((len(q), 4, 4))
        T[:, :3], T[:, 3, 3] = rows, 1.0
        axes, origins = np.stack([f[:, :, 2] for f in frames], -1), np.stack([f[:, :, 3] for f in frames], -1)
        arm = rows[:, :, 3, None] - origins
        J = np.empty((len(q), 6, self.dof))
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            J[:, i] = axes[:, j] * arm[:, k] - axes[:, k] * arm[:, j]
        J[:, 3:] = axes
        return T, J

    def _walk(self, q: Array, keep: bool) -> tuple[Array, list[Array]]:
        """The upper rows (b, 3, 4) of the tool's pose, and those of every joint's frame if kept."""
        X = np.broadcast_to(self.fixed[0, :3], (len(q), 3, 4)).copy()
        cos, sin = np.cos(q)[:, :, None], np.sin(q)[:, :, None]
        frames = []
        for i in range(self.dof):
            x, y = X[:, :, 0], X[:, :, 1]
            c, s = cos[:, i], sin[:, i]
            X[:, :, 0], X[:, :, 1] = c * x + s * y, c * y - s * x
            if keep:
                frames.append(X)
            # One product of tall matrices instead of b small ones.
            X = (X.reshape(-1, 4) @ self.fixed[i + 1]).reshape(-1, 3, 4)
        return X, frames


def _turn_z_to(axis: Array) -> Array:
    """A rotation (4, 4) that takes z to a unit vector."""
    x, y, z = axis
    T = np.eye(4)
    if z < -0.999999:
        T[:3, :3] = np.diag([1.0, -1.0, -1.0])
    else:
        k = 1 / (1 + z)
        T[:3, :3] = [[1 - k * x * x, -k * x * y, x], [-k * x * y, 1 - k * y * y, y], [-x, -y, z]]
    return T
