"""Truncated Quantile Critics in float64 numpy, from the paper (arXiv:2005.04269), without torch."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def quantile_huber(quantiles: Array, atoms: Array) -> Array:
    """``(B, C, N)`` and ``(B, K)`` to the loss of each critic, ``(B, C)``; one term after the other."""
    batch, critics, n = quantiles.shape
    losses = np.zeros((batch, critics))
    for b in range(batch):
        for c in range(critics):
            terms = []
            for m in range(n):
                level = (2 * m + 1) / (2 * n)
                for atom in atoms[b]:
                    u = atom - quantiles[b, c, m]
                    huber = 0.5 * u * u if abs(u) <= 1 else abs(u) - 0.5
                    terms.append(abs(level - float(u < 0)) * huber)
            losses[b, c] = np.mean(terms)
    return losses


def target_atoms(
    quantiles: Array, log_prob: Array, reward: Array, terminated: Array, gamma: float, alpha: float, drop_per_net: int
) -> Array:
    """Pool the critics' quantiles, sort, drop the largest, add entropy and reward: ``(B, K)``."""
    critics = quantiles.shape[1]
    rows = []
    for atoms, log_p, r, end in zip(quantiles, log_prob, reward, terminated, strict=True):
        pooled = sorted(atoms.reshape(-1))
        kept = np.array(pooled[: len(pooled) - critics * drop_per_net])
        rows.append(r + gamma * (1 - end) * (kept - alpha * log_p))
    return np.array(rows)


def actor_loss(quantiles: Array, log_prob: Array, alpha: float) -> float:
    """The full mixture, nothing dropped."""
    return float(np.mean(alpha * log_prob - quantiles.mean(axis=(1, 2))))


def alpha_loss(log_alpha: float, log_prob: Array, target_entropy: float) -> float:
    return float(np.mean(-log_alpha * (log_prob + target_entropy)))
