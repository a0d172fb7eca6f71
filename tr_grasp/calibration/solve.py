"""Where a camera is, from samples: closed form, outliers, refinement, noise, uncertainty."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tr_grasp.calibration.closed_form import METHODS, Method, solve_closed_form
from tr_grasp.calibration.coverage import Coverage, require_coverage
from tr_grasp.calibration.outliers import STARTS, best_fit, find_outliers
from tr_grasp.calibration.problem import Noise, Problem, Solution, prior_noise
from tr_grasp.calibration.rigid import Array
from tr_grasp.calibration.samples import SETUPS, Sample, Setup
from tr_grasp.calibration.uncertainty import Uncertainty, board_scale, bootstrap, held_out
from tr_grasp.errors import CalibrationError, unknown_name

DRAWS_N = 2000
WRONG_SCALE, DOUBTFUL_SCALE = 0.02, 0.004
BAD_ERROR_M = 0.010
ABSURD_ERROR_M, ABSURD_ERROR_RAD = 0.050, 0.20
"""Where samples are further off than this on average, they are not of one camera and one board."""
FAILED_M, FAILED_RATIO = 0.020, 5.0
"""A closed form failed where samples are this much, and this many times, further off than after the refinement."""


@dataclass(frozen=True)
class SampleError:
    """How far a sample's board is from where the calibration expects it."""

    name: str
    translation_m: float
    rotation_rad: float
    held_out_m: float | None
    """The same under a calibration without this sample; nothing for samples that are left out anyway."""
    held_out_rad: float | None
    outlier: bool


@dataclass(frozen=True, eq=False)
class HandEyeResult:
    """A calibration.

    Attributes:
        setup: Where the camera is.
        method: Solver of the closed form.
        refined: Whether the joint refinement followed it.
        T_parent_cam: (4, 4) ``T_base_cam`` (eye on base) or ``T_tcp_cam`` (eye in hand).
        T_parent_board: (4, 4) ``T_tcp_board`` (eye on base) or ``T_base_board`` (eye in hand).
        uncertainty: 95 % radius.
        noise: What the samples say about the noise of corners and robot.
        board_scale: Size of the board as a multiple of what was assumed, as the robot's motion says.
        board_scale_error: Standard error of it.
        samples: Error of every sample.
        coverage: How the hand moved.
        warnings: Sentences for whoever uses the result.
    """

    setup: Setup
    method: Method
    refined: bool
    T_parent_cam: Array
    T_parent_board: Array
    uncertainty: Uncertainty
    noise: Noise
    board_scale: float
    board_scale_error: float
    samples: tuple[SampleError, ...]
    coverage: Coverage
    warnings: tuple[str, ...]

    @property
    def name(self) -> str:
        """``T_base_cam`` or ``T_tcp_cam``."""
        return "T_base_cam" if self.setup == "eye_on_base" else "T_tcp_cam"

    @property
    def board_name(self) -> str:
        """``T_tcp_board`` or ``T_base_board``."""
        return "T_tcp_board" if self.setup == "eye_on_base" else "T_base_board"

    @property
    def outliers(self) -> list[str]:
        """Names of samples that were left out."""
        return [sample.name for sample in self.samples if sample.outlier]

    @property
    def held_out_m(self) -> float | None:
        """Mean error of a sample under the calibration of the others; nothing where they are too few for that."""
        return _mean([sample.held_out_m for sample in self.samples])

    @property
    def held_out_rad(self) -> float | None:
        """As :attr:`held_out_m`, the rotation."""
        return _mean([sample.held_out_rad for sample in self.samples])


def solve_hand_eye(
    samples: Sequence[Sample],
    setup: Setup,
    method: Method = "daniilidis",
    *,
    refine: bool = True,
    reject_outliers: bool = True,
    draws_n: int = DRAWS_N,
    rng: np.random.Generator | None = None,
) -> HandEyeResult:
    """Find where the camera is.

    Args:
        samples: Three or more, with rotations about axes that are not parallel; all with corners, or all without.
        setup: ``eye_on_base`` (the hand holds the board) or ``eye_in_hand`` (the hand holds the camera).
        method: Solver that gives the first solution.
        refine: Go on to the joint least squares of all corners over both unknown transforms.
        reject_outliers: Leave out samples that contradict the others; their names are in the result.
        draws_n: Draws of the bootstrap.
        rng: For the bootstrap; a fixed seed if not given.

    Raises:
        CalibrationError: Too few samples, rotations about parallel axes, an unknown method, markers of another size
            than was said, samples that are 50 mm or 11 degrees off on average, a solver that finds nothing, or,
            without refinement, one whose answer does not fit the samples.
    """
    if setup not in SETUPS:
        raise CalibrationError(unknown_name("setup", str(setup), SETUPS))
    if method not in METHODS:
        raise CalibrationError(unknown_name("method", str(method), METHODS))
    with_corners = [sample.information is not None for sample in samples]
    if any(with_corners) and not all(with_corners):
        raise CalibrationError("samples with corners and samples of poses alone cannot be mixed in one calibration.")
    require_coverage(samples)
    pixel_px = _pixel_noise(samples)
    out = find_outliers(samples, setup, prior_noise(pixel_px)) if reject_outliers else []
    kept = [sample for i, sample in enumerate(samples) if i not in out]
    coverage = require_coverage(kept)
    problem = Problem(kept, setup)
    solution, noise = _refined(kept, setup, method, pixel_px)
    _refuse_absurd(problem, solution)
    scale, scale_error = board_scale(problem, solution, noise)
    _refuse_wrong_scale(scale, scale_error)
    if not refine:
        solution = _closed_form(kept, setup, method, solution)
    uncertainty = bootstrap(problem, solution, noise, draws_n, rng or np.random.default_rng(0))
    errors = _sample_errors(samples, out, setup, method, refine, solution, noise)
    return HandEyeResult(
        setup, method, refine, solution.X, solution.Z, uncertainty, noise, scale, scale_error, errors, coverage,
        tuple(_warnings(samples, out, errors, coverage) + _scale_warning(scale, scale_error)),
    )  # fmt: skip


def _refined(samples: Sequence[Sample], setup: Setup, method: Method, pixel_px: float) -> tuple[Solution, Noise]:
    """Noise and solution depend on each other: twice each.

    From noisy samples a closed form may start badly, so the refinement starts from others too; the lowest cost wins.
    """
    noise, problem = prior_noise(pixel_px), Problem(samples, setup)
    solution = best_fit(samples, setup, noise, (method, *STARTS))
    if solution is None:
        raise CalibrationError("the refinement finds no solution for these samples; look at them, or take others.")
    for _ in range(2):
        noise = problem.estimate_noise(solution.X, solution.Z, pixel_px)
        solution = problem.refine(solution.X, solution.Z, noise)
    return solution, noise


def _closed_form(samples: Sequence[Sample], setup: Setup, method: Method, refined: Solution) -> Solution:
    """The closed form alone.

    Raises:
        CalibrationError: It failed: samples are far better explained by the refined solution.
    """
    X, Z = solve_closed_form(samples, setup, method)
    problem = Problem(samples, setup)
    far, least = (_mean_error(problem, *pair)[0] for pair in ((X, Z), (refined.X, refined.Z)))
    if far > max(least + FAILED_M, FAILED_RATIO * least):
        raise CalibrationError(
            f"the method {method!r} alone leaves samples {1e3 * far:.0f} mm off on average, the refinement "
            f"{1e3 * least:.1f} mm; refine, or choose another method."
        )
    return replace(refined, X=X, Z=Z)


def _mean_error(problem: Problem, X: Array, Z: Array) -> tuple[float, float]:
    """How far boards are from where they should be, in translation [m] and rotation [rad]."""
    errors = problem.errors(X, Z)
    far, turned = (np.linalg.norm(part, axis=1).mean() for part in (errors[:, :3], errors[:, 3:]))
    return float(far), float(turned)


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def _pixel_noise(samples: Sequence[Sample]) -> float:
    """Standard deviation [px] of corners in u and v, from what the poses of the board leave unexplained."""
    squares, freedom = 0.0, 0
    for sample in samples:
        if sample.pixels is None or sample.reprojection_px is None:
            continue
        squares += len(sample.pixels) * sample.reprojection_px**2
        freedom += 2 * len(sample.pixels) - 6
    return float(np.sqrt(squares / freedom)) if freedom > 0 and squares > 0 else 0.05


def _sample_errors(
    samples: Sequence[Sample], out: list[int], setup: Setup, method: Method, refine: bool, solution: Solution,
    noise: Noise,
) -> tuple[SampleError, ...]:  # fmt: skip
    errors = Problem(samples, setup).errors(solution.X, solution.Z)
    kept = [i for i in range(len(samples)) if i not in out]
    without = _held_out_errors([samples[i] for i in kept], setup, method, refine, solution, noise)
    found = []
    for i, sample in enumerate(samples):
        shift, turn = (float(np.linalg.norm(part)) for part in (errors[i, :3], errors[i, 3:]))
        others = without[kept.index(i)] if i in kept and without is not None else (None, None)
        far, turned = (None if value is None else float(value) for value in others)
        found.append(SampleError(sample.name, shift, turn, far, turned, i in out))
    return tuple(found)


def _held_out_errors(
    samples: list[Sample], setup: Setup, method: Method, refine: bool, solution: Solution, noise: Noise
) -> Array | None:
    """(n, 2) [m, rad]; nothing where the samples without one determine nothing."""
    problem, solutions = Problem(samples, setup), []
    for i in range(len(samples)):
        others = samples[:i] + samples[i + 1 :]
        try:
            require_coverage(others)
            if refine:
                solutions.append(Problem(others, setup).refine(solution.X, solution.Z, noise))
            else:
                X, Z = solve_closed_form(others, setup, method)
                solutions.append(replace(solution, X=X, Z=Z))
        except CalibrationError:
            return None
    return held_out(problem, solutions)


def _refuse_wrong_scale(scale: float, error: float) -> None:
    if abs(scale - 1) > max(WRONG_SCALE, 5 * error):
        raise CalibrationError(
            f"the board is {scale:.3f} ± {error:.3f} times as large as was said, as the robot's motion shows; "
            "measure a marker of the printed board and correct marker_m, or check the camera's focal length."
        )


def _scale_warning(scale: float, error: float) -> list[str]:
    if abs(scale - 1) <= max(DOUBTFUL_SCALE, 5 * error):
        return []
    return [
        f"by the robot's motion the board is {scale:.4f} ± {error:.4f} times as large as was said: measure a marker "
        "again, or calibrate the camera's focal length."
    ]


def _refuse_absurd(problem: Problem, solution: Solution) -> None:
    far, turned = _mean_error(problem, solution.X, solution.Z)
    if far > ABSURD_ERROR_M or turned > ABSURD_ERROR_RAD:
        raise CalibrationError(
            f"no place of the camera fits: samples stay {1e3 * far:.0f} mm and {np.degrees(turned):.0f} degrees off on "
            "average; check the setup (eye_on_base or eye_in_hand), the order of quaternions, units, and that camera "
            "and board are fixed."
        )


def _warnings(
    samples: Sequence[Sample], out: list[int], errors: Sequence[SampleError], coverage: Coverage
) -> list[str]:
    found = [f"sample {samples[i].name} contradicts the others and was left out; look at its picture." for i in out]
    if len(out) > len(samples) / 3:
        found.append("more than a third of the samples was left out: the board or the camera is probably loose.")
    far = np.mean([error.translation_m for error in errors if not error.outlier])
    if far > BAD_ERROR_M:
        found.append(
            f"samples are {1e3 * far:.0f} mm off on average, 10 mm are bad: is the board or the camera loose, do the "
            "intrinsics belong to this resolution, is the robot's pose that of the picture's moment?"
        )
    return found + list(coverage.missing)
