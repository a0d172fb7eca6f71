"""How far off a calibration may be: by a bootstrap, by a sample left out, by the scale that samples ask for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tr_grasp.calibration.problem import UNKNOWNS_N, Noise, Problem, Solution
from tr_grasp.calibration.rigid import Array, angle_rad, distance_m

CONFIDENCE = 0.95


@dataclass(frozen=True)
class Uncertainty:
    """Radius around the estimate within which the truth lies with 95 % confidence.

    It knows random errors of corners and robot. What moves all samples in the same way, as wrong intrinsics do, it does
    not see.
    """

    translation_m: float
    """Of the camera's position."""

    rotation_rad: float
    """Of the camera's rotation, as an angle."""

    def covers(self, T_estimate: Array, T_truth: Array) -> tuple[bool, bool]:
        """Whether the truth is within the radius, in translation and in rotation."""
        return (
            distance_m(T_estimate, T_truth) <= self.translation_m,
            angle_rad(T_estimate, T_truth) <= self.rotation_rad,
        )


def bootstrap(
    problem: Problem, solution: Solution, noise: Noise, draws_n: int, rng: np.random.Generator
) -> Uncertainty:
    """Parametric bootstrap-t: draw errors from the fitted noise, solve again, measure in units of each draw's scale.

    Solving again is one weighted least-squares step: errors are millimetres, at which the equations are linear.
    Dividing by each draw's own scale accounts for how little a few samples say about their noise (as Student's t does).
    """
    A = problem.jacobian(solution.X, solution.Z)
    C = problem.covariances(solution.X, solution.Z, noise)
    root_inverse = np.linalg.inv(np.linalg.cholesky(C))
    white = (root_inverse @ A).reshape(-1, UNKNOWNS_N)
    freedom = len(white) - UNKNOWNS_N
    solve = np.linalg.pinv(white)
    drawn = rng.standard_normal((draws_n, len(white)))
    moved = drawn @ solve.T
    rest = drawn - moved @ white.T
    scale = np.sqrt((rest**2).sum(1) / freedom)[:, None]
    found = (root_inverse @ problem.errors(solution.X, solution.Z)[..., None]).ravel()
    fitted = max(1.0, float(np.sqrt((found**2).sum() / freedom)))
    studentised = fitted * moved[:, :6] / scale
    shift, turn = (np.linalg.norm(studentised[:, part], axis=1) for part in (slice(0, 3), slice(3, 6)))
    return Uncertainty(float(np.quantile(shift, CONFIDENCE)), float(np.quantile(turn, CONFIDENCE)))


def board_scale(problem: Problem, solution: Solution, noise: Noise) -> tuple[float, float]:
    """How large the board is, as a multiple of what was assumed, and the standard error of that.

    The robot's motion has a scale of its own, so samples tell whether markers were measured right.
    """
    scale, _ = _scale_step(problem, solution, noise)
    # The noise was found as if the size were right, so it is too large where it is not: once more with the right one.
    scaled = problem.with_scale(scale)
    solution = scaled.refine(solution.X, solution.Z, noise)
    noise = scaled.estimate_noise(solution.X, solution.Z, noise.pixel_px)
    correction, error = _scale_step(scaled, scaled.refine(solution.X, solution.Z, noise), noise)
    return scale * correction, scale * error


def _scale_step(problem: Problem, solution: Solution, noise: Noise) -> tuple[float, float]:
    """One step of least squares over X, Z and the scale of all distances to the board."""
    A = problem.jacobian(solution.X, solution.Z)
    R, t = problem.seen[:, :3, :3], problem.seen[:, :3, 3]
    # A larger board was further away, along the line of sight.
    away = -np.concatenate([(np.swapaxes(R, 1, 2) @ t[..., None])[..., 0], np.zeros_like(t)], axis=1)
    A = np.concatenate([A, away[..., None]], axis=2)
    W = np.linalg.inv(problem.covariances(solution.X, solution.Z, noise))
    normal = np.einsum("nij,nik,nkl->jl", A, W, A)
    gradient = np.einsum("nij,nik,nk->j", A, W, problem.errors(solution.X, solution.Z))
    covariance = np.linalg.inv(normal)
    return 1.0 - float((covariance @ gradient)[-1]), float(np.sqrt(covariance[-1, -1]))


def held_out(problem: Problem, solutions: list[Solution]) -> Array:
    """(n, 2) [m, rad] error of each sample's board under the solution that was found without it."""
    errors = np.array([problem.errors(s.X, s.Z)[i] for i, s in enumerate(solutions)])
    return np.stack([np.linalg.norm(errors[:, :3], axis=1), np.linalg.norm(errors[:, 3:], axis=1)], axis=1)
