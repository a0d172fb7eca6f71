"""Joint angles that reach a pose, by damped least squares from several starts at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tr_grasp.motion.arguments import Array
from tr_grasp.motion.kinematics import Kinematics

LENGTH_M = 0.3
"""An error of this length weighs as much as one of 1 rad."""
LARGEST_STEP_RAD = 0.6
NEIGHBOURS_N = 64


@dataclass(frozen=True)
class Tolerance:
    """How near the tool must come to the pose asked for."""

    position_m: float = 1e-5
    rotation_rad: float = 1e-4


class LeastSquaresIK:
    """Many poses, each from several starts, all in one batch.

    Starts come from a library of random joint vectors: those whose tool is nearest to the pose. From there, two thirds
    of all poses of a 7-joint arm take one attempt. Steps stay inside the joint limits.

    Args:
        kinematics: The arm.
        library_n: Joint vectors in the library.
        seed: Of the library.

    Source: Sugihara 2011, Solvability-unconcerned inverse kinematics by the Levenberg-Marquardt method (the damping).
    """

    def __init__(self, kinematics: Kinematics, library_n: int = 4096, seed: int = 0) -> None:
        self._arm = kinematics
        middle = (kinematics.lower_rad + kinematics.upper_rad) / 2
        half = np.minimum((kinematics.upper_rad - kinematics.lower_rad) / 2, np.pi)
        rng = np.random.default_rng(seed)
        self._library = middle + half * rng.uniform(-1.0, 1.0, (library_n, kinematics.dof))
        self._features = _features(kinematics.chain.pose(self._library))
        self._norms = (self._features**2).sum(1)

    def starts(self, T_base_tcp: Array, n: int, skip: int = 0) -> Array:
        """(b, n, dof) joints of the library whose tools are nearest to poses (b, 4, 4), after the first ``skip``."""
        wanted = _features(T_base_tcp)
        gaps = self._norms - 2 * wanted @ self._features.T
        last = min(skip + n, gaps.shape[1])
        near = np.argpartition(gaps, last - 1, axis=1)[:, :last]
        order = np.argsort(np.take_along_axis(gaps, near, 1), axis=1)
        return self._library[np.take_along_axis(near, order, 1)[:, skip:]]

    def solve(self, T_base_tcp: Array, starts: Array, tolerance: Tolerance, iterations_n: int) -> Array:
        """Joints (b, dof) that reach the poses (b, 4, 4) from starts (b, dof); NaN where they do not get there."""
        arm = self._arm
        q = np.clip(starts, arm.lower_rad, arm.upper_rad)
        found = np.full(q.shape, np.nan)
        active = np.arange(len(q))
        for _ in range(iterations_n):
            T, J = arm.chain.pose_and_jacobian(q)
            error = pose_error(T_base_tcp[active], T)
            there = (np.linalg.norm(error[:, :3], axis=1) < tolerance.position_m) & (
                np.linalg.norm(error[:, 3:], axis=1) < tolerance.rotation_rad
            )
            found[active[there]] = q[there]
            active, q, J, error = active[~there], q[~there], J[~there], error[~there]
            if not len(active):
                break
            q = np.clip(q + damped_step(J, error), arm.lower_rad, arm.upper_rad)
        return found


def pose_error(T_goal: Array, T: Array) -> Array:
    """(b, 6): way [m] over rotation vector [rad], in base axes, from poses (b, 4, 4) to goals."""
    R = T_goal[:, :3, :3] @ T[:, :3, :3].swapaxes(1, 2)
    turn = 0.5 * np.stack([R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], axis=1)
    sine = np.linalg.norm(turn, axis=1)
    angle = np.arctan2(sine, (np.trace(R, axis1=1, axis2=2) - 1) / 2)
    turn *= np.where(sine > 1e-9, angle / np.maximum(sine, 1e-9), 1.0)[:, None]
    return np.concatenate([T_goal[:, :3, 3] - T[:, :3, 3], turn], axis=1)


def damped_step(J: Array, error: Array) -> Array:
    """(b, dof) step of the joints that reduces errors (b, 6); the damping falls with the error, as squares do."""
    weight = np.array([1 / LENGTH_M] * 3 + [1.0] * 3)
    J, error = J * weight[:, None], error * weight
    damping = 0.1 * (error**2).sum(1) + 1e-6
    gram = J @ J.swapaxes(1, 2)
    gram[:, range(6), range(6)] += damping[:, None]
    step = (J.swapaxes(1, 2) @ np.linalg.solve(gram, error[..., None]))[..., 0]
    largest = np.abs(step).max(1, keepdims=True)
    return step * np.minimum(1.0, LARGEST_STEP_RAD / np.maximum(largest, 1e-12))


def _features(T: Array) -> Array:
    """(b, 12) numbers of poses whose squared distance weighs 0.3 m like 1 rad (of a small turn)."""
    return np.concatenate([T[:, :3, 3] / LENGTH_M, T[:, :3, :3].reshape(len(T), 9) / np.sqrt(2)], axis=1)
