"""Samples that do not fit the others: a board that slipped, a pose read too early, a picture of another moment."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import f as f_distribution

from tr_grasp.calibration.closed_form import Method, solve_closed_form
from tr_grasp.calibration.coverage import coverage_of
from tr_grasp.calibration.problem import UNKNOWNS_N, Noise, Problem, Solution
from tr_grasp.calibration.samples import Sample, Setup
from tr_grasp.errors import CalibrationError

SIGNIFICANCE = 0.001
LEAST_KEPT = 4
LEAST_WRONG_M, LEAST_WRONG_RAD = 1e-3, 3e-3
"""Samples that are less far off do no harm, however sure it is that they are off."""
CONSISTENT = 0.3
"""Samples whose errors are this small a part of a robot's usual noise are not searched."""
STARTS: tuple[Method, ...] = ("park", "shah")


def find_outliers(samples: Sequence[Sample], setup: Setup, noise: Noise) -> list[int]:
    """Positions of samples without which the others agree far better; one after the other, the worst first.

    A sample is out where an F test of the errors with and without it has p below 0.001, divided by the number of
    samples that could have been chosen; with usual noise, and with the noise that the others show among themselves.
    And it is off by more than a millimetre or 0.2 degrees.

    Args:
        samples: All of them.
        setup: Where the camera is.
        noise: That of the corners, and what a robot's noise usually is.
    """
    everything = _cost(samples, setup, noise)
    if everything is not None and everything < CONSISTENT * (6 * len(samples) - UNKNOWNS_N):
        return []
    kept: list[int] = list(range(len(samples)))
    found: list[int] = []
    while len(kept) > LEAST_KEPT:
        suspect = _worst(samples, kept, setup, noise)
        if suspect is None:
            break
        others = [samples[k] for k in kept if k != suspect]
        among_others = _noise_of(others, setup, noise)
        everyone = [samples[k] for k in kept]
        if not _is_far(samples[suspect], others, setup, among_others):
            break
        if not all(_contradicts(everyone, others, setup, usual) for usual in (noise, among_others)):
            break
        found.append(suspect)
        kept.remove(suspect)
    return found


def best_fit(samples: Sequence[Sample], setup: Setup, noise: Noise, methods: Sequence[Method]) -> Solution | None:
    """Refinement from the closed form of each method; the one with the least cost."""
    problem = Problem(samples, setup)
    found: list[tuple[float, Solution]] = []
    for method in methods:
        try:
            solution = problem.refine(*solve_closed_form(samples, setup, method), noise)
        except (CalibrationError, np.linalg.LinAlgError):
            continue
        cost = problem.cost(solution.X, solution.Z, noise)
        if np.isfinite(cost):
            found.append((cost, solution))
    return min(found, key=lambda pair: pair[0])[1] if found else None


def _worst(samples: Sequence[Sample], kept: list[int], setup: Setup, noise: Noise) -> int | None:
    """The sample without which the others have the least errors."""
    costs = {i: _cost([samples[k] for k in kept if k != i], setup, noise) for i in kept}
    finite = {i: cost for i, cost in costs.items() if cost is not None}
    return min(finite, key=lambda i: finite[i]) if finite else None


def _is_far(sample: Sample, others: Sequence[Sample], setup: Setup, noise: Noise) -> bool:
    solution = best_fit(others, setup, noise, STARTS)
    if solution is None:
        return False
    error = Problem([sample], setup).errors(solution.X, solution.Z)[0]
    return bool(np.linalg.norm(error[:3]) > LEAST_WRONG_M or np.linalg.norm(error[3:]) > LEAST_WRONG_RAD)


def _contradicts(everyone: Sequence[Sample], others: Sequence[Sample], setup: Setup, noise: Noise) -> bool:
    with_all, without = _cost(everyone, setup, noise), _cost(others, setup, noise)
    if with_all is None or without is None:
        return False
    freedom = 6 * len(others) - UNKNOWNS_N
    ratio = ((with_all - without) / 6) / max(without / freedom, 1e-9)
    return float(f_distribution.sf(ratio, 6, freedom)) * len(everyone) < SIGNIFICANCE


def _noise_of(samples: Sequence[Sample], setup: Setup, noise: Noise) -> Noise:
    solution = best_fit(samples, setup, noise, STARTS)
    if solution is None:
        return noise
    return Problem(samples, setup).estimate_noise(solution.X, solution.Z, noise.pixel_px)


def _cost(samples: Sequence[Sample], setup: Setup, noise: Noise) -> float | None:
    """Weighted squared errors after refinement; nothing where these samples determine nothing."""
    if coverage_of(samples).degenerate:
        return None
    solution = best_fit(samples, setup, noise, STARTS)
    return None if solution is None else Problem(samples, setup).cost(solution.X, solution.Z, noise)
