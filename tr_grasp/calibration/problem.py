"""The equations of hand-eye calibration, the same for both setups, and their best solution.

With ``hand`` for ``T_base_tcp`` of a camera in the hand and for ``T_tcp_base`` of a camera beside the robot, each
sample says ``T_cam_board = inv(X) · inv(hand) · Z``: ``X`` is where the camera is (``T_tcp_cam`` or ``T_base_cam``)
and ``Z`` where the board is (``T_base_board`` or ``T_tcp_board``).

A sample's error is the small motion of the board between where it was seen and where it should be. Its covariance adds
what the corners' error in pixels does to the pose and what an error of the robot's pose does. Weighted by the first
alone, the least squares of these errors are those of the reprojection error: every change of X and Z moves a sample's
board as a rigid body, so the rest of its corner errors cannot change.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from tr_grasp.calibration.rigid import Array, adjoint, small_motion, transform_of
from tr_grasp.calibration.samples import Sample, Setup, base_tcp, cam_board
from tr_grasp.geometry import invert_transform

UNKNOWNS_N = 12
PRIOR_POSITION_M, PRIOR_ROTATION_RAD = 5e-4, 2e-3
SMALLEST_M, SMALLEST_RAD = 1e-5, 2e-5
LARGEST_M, LARGEST_RAD = 0.05, 0.2


@dataclass(frozen=True)
class Noise:
    """Standard deviations of what goes wrong in a sample, along and about each axis."""

    pixel_px: float
    """Of a corner, in u and v."""

    position_m: float
    """Of the robot's pose."""

    rotation_rad: float
    """Of the robot's pose."""


@dataclass(frozen=True, eq=False)
class Solution:
    """Two transforms and how well they are known.

    Attributes:
        X, Z: (4, 4) where the camera and where the board is.
        covariance: (12, 12) of small motions of X and Z in their own frames.
    """

    X: Array
    Z: Array
    covariance: Array


class Problem:
    """Samples as arrays.

    Args:
        samples: All with corners, or all without.
        setup: Where the camera is.
    """

    def __init__(self, samples: Sequence[Sample], setup: Setup) -> None:
        self.setup = setup
        hand = base_tcp(samples)
        self.hand = hand if setup == "eye_in_hand" else invert_transform(hand)
        self.seen = cam_board(samples)
        known = [sample.information for sample in samples if sample.information is not None]
        self.pixel_covariance = np.linalg.inv(np.array(known)) if len(known) == len(samples) else None

    def __len__(self) -> int:
        return len(self.hand)

    def with_scale(self, scale: float) -> Problem:
        """The same with boards ``scale`` times as far from the camera."""
        other = copy(self)
        other.seen = self.seen.copy()
        other.seen[:, :3, 3] *= scale
        return other

    def expected(self, X: Array, Z: Array) -> Array:
        """(n, 4, 4) ``T_cam_board`` that follow from X and Z."""
        return invert_transform(X) @ invert_transform(self.hand) @ Z

    def errors(self, X: Array, Z: Array) -> Array:
        """(n, 6) small motions from where boards were seen to where they should be, in the board's frame."""
        return small_motion(invert_transform(self.seen) @ self.expected(X, Z))

    def jacobian(self, X: Array, Z: Array) -> Array:
        """(n, 6, 12) of the errors by small motions of X and Z."""
        moved = -adjoint(invert_transform(self.expected(X, Z)))
        return np.concatenate([moved, np.broadcast_to(np.eye(6), moved.shape)], axis=2)

    def covariances(self, X: Array, Z: Array, noise: Noise) -> Array:
        """(n, 6, 6) of the errors."""
        T_tcp_board = (
            invert_transform(self.hand) @ Z if self.setup == "eye_in_hand" else np.broadcast_to(Z, self.hand.shape)
        )
        carry = adjoint(invert_transform(T_tcp_board))
        robot = np.diag([noise.position_m**2] * 3 + [noise.rotation_rad**2] * 3)
        total = carry @ robot @ np.swapaxes(carry, 1, 2)
        if self.pixel_covariance is not None:
            total = total + noise.pixel_px**2 * self.pixel_covariance
        return total

    def refine(self, X: Array, Z: Array, noise: Noise, iterations_n: int = 50) -> Solution:
        """Weighted least squares of the errors (Levenberg-Marquardt), from a solution that is about right."""
        weights = np.linalg.inv(self.covariances(X, Z, noise))
        cost, damping = self._weighted(X, Z, weights), 1e-9
        normal, gradient = self._normal(X, Z, weights)
        for _ in range(iterations_n):
            step = -np.linalg.solve(normal + damping * np.diag(np.diag(normal)), gradient)
            moved = X @ transform_of(step[:6]), Z @ transform_of(step[6:])
            lower = self._weighted(*moved, weights)
            if not lower <= cost * (1 + 1e-12) + 1e-15:
                damping = max(10 * damping, 1e-4)
                continue
            (X, Z), cost, damping = moved, lower, damping / 10
            normal, gradient = self._normal(X, Z, weights)
            if np.abs(step).max() < 1e-9:
                break
        return Solution(X, Z, np.linalg.inv(normal))

    def _weighted(self, X: Array, Z: Array, weights: Array) -> float:
        e = self.errors(X, Z)
        return float(np.einsum("ni,nij,nj->", e, weights, e))

    def _normal(self, X: Array, Z: Array, weights: Array) -> tuple[Array, Array]:
        """Matrix (12, 12) and gradient (12,) of the normal equations."""
        A = self.jacobian(X, Z)
        WA = weights @ A
        return np.einsum("nij,nik->jk", A, WA), np.einsum("nij,ni->j", WA, self.errors(X, Z))

    def cost(self, X: Array, Z: Array, noise: Noise) -> float:
        """Sum of squared errors in units of their covariance."""
        return self._weighted(X, Z, np.linalg.inv(self.covariances(X, Z, noise)))

    def estimate_noise(self, X: Array, Z: Array, pixel_px: float) -> Noise:
        """The robot's noise that makes errors near a solution most likely (restricted maximum likelihood).

        The likelihood is of what X and Z cannot explain, so few samples do not look better than they are.
        """
        A, e = self.jacobian(X, Z), self.errors(X, Z)

        def unlikely(logs: Array) -> float:
            noise = Noise(pixel_px, float(np.exp(logs[0])), float(np.exp(logs[1])))
            C = self.covariances(X, Z, noise)
            W = np.linalg.inv(C)
            WA = W @ A
            normal, gradient = np.einsum("nij,nik->jk", A, WA), np.einsum("nij,ni->j", WA, e)
            rest = np.einsum("ni,nij,nj->", e, W, e) - gradient @ np.linalg.solve(normal, gradient)
            return float(np.linalg.slogdet(C)[1].sum() + np.linalg.slogdet(normal)[1] + rest)

        bounds = np.log([[SMALLEST_M, LARGEST_M], [SMALLEST_RAD, LARGEST_RAD]])
        start = np.log([PRIOR_POSITION_M, PRIOR_ROTATION_RAD])
        best = minimize(
            unlikely, start, method="Nelder-Mead", bounds=bounds, options={"xatol": 0.03, "fatol": 0.01, "maxfev": 120}
        )
        position, rotation = np.exp(best.x)
        return Noise(pixel_px, float(position), float(rotation))


def prior_noise(pixel_px: float) -> Noise:
    """What a robot's noise usually is, before samples tell."""
    return Noise(pixel_px, PRIOR_POSITION_M, PRIOR_ROTATION_RAD)
