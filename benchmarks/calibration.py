"""Hand-eye calibration in the simulated laboratory: ``python -m benchmarks.calibration --out FOLDER``.

Prints JSON rows: error against the truth for both setups, 5, 11 and 15 samples, clean and with four kinds of trouble,
and how often the bootstrap's 95 % radius covers the truth. Beside it the closed form alone, and how far OpenCV's solver
of the same name is from it. Every run is kept in FOLDER, so that a stopped measurement goes on.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np

from benchmarks._common import machine
from benchmarks._laboratories import kept_runs
from tr_grasp.calibration.closed_form import solve_closed_form
from tr_grasp.calibration.coverage import coverage_of
from tr_grasp.calibration.detection import Refused, detect_board
from tr_grasp.calibration.intrinsics import Intrinsics
from tr_grasp.calibration.laboratory import IntrinsicsError, LabCfg, Laboratory
from tr_grasp.calibration.problem import Problem
from tr_grasp.calibration.rendering import ImageNoise, render_board
from tr_grasp.calibration.rigid import Array, angle_rad, distance_m
from tr_grasp.calibration.samples import SETUPS, Sample, Setup
from tr_grasp.calibration.session import sample_of
from tr_grasp.calibration.solve import solve_hand_eye
from tr_grasp.calibration.views import View
from tr_grasp.evaluation.statistics import Counts, wilson_interval
from tr_grasp.geometry import transform_from

SAMPLES_N = (5, 11, 15)
CONDITIONS = ("clean", "rgb_noise", "kinematics_noise", "wrong_sample", "inexact_camera")
RGB_LEVELS = 6.0
LENS = (0.12, -0.25, 0.001, -0.0005, 0.1)
INEXACT = IntrinsicsError(focal=0.002, centre_px=1.0, distortion=0.05)
EQUAL_MM = 1e-6
KINEMATICS = {"kinematics_position_m": 0.001, "kinematics_rotation_deg": 0.3}


@dataclass(frozen=True)
class Run:
    """One calibration and how far off it is."""

    setup: Setup
    condition: str
    samples_n: int
    seed: int
    translation_mm: float
    rotation_deg: float
    closed_form_mm: float
    closed_form_deg: float
    opencv_apart_mm: float
    largest_turn_deg: float
    radius_mm: float
    radius_deg: float
    covers_translation: bool
    covers_rotation: bool
    outliers_right: bool


def pictured(lab: Laboratory, views: list[View], levels: float) -> list[Sample]:
    """What the camera sees at each view, with the robot's true pose."""
    found = []
    for i, view in enumerate(views):
        T_true = lab.kinematics.pose(view.q_rad)
        picture = render_board(
            lab.cfg.board, lab.T_cam_board(T_true), lab.cfg.camera, ImageNoise(levels=levels), lab.rng
        )
        seen = detect_board(picture, lab.cfg.board, lab.told_camera)
        if isinstance(seen, Refused):
            raise SystemExit(f"seed {lab.cfg.seed}, view {i}: {seen.sentence}")
        found.append(sample_of(str(i), T_true, seen))
    return found


def told(lab: Laboratory, samples: list[Sample], wrong: int | None = None) -> list[Sample]:
    """The same with the pose that the robot tells."""
    return [replace(s, T_base_tcp=lab.told(s.T_base_tcp, i == wrong)) for i, s in enumerate(samples)]


def runs_of(setup: Setup, seed: int) -> Iterator[Run]:
    """All conditions and numbers of samples in one laboratory, on one set of views."""
    lab = Laboratory(LabCfg(setup=setup, seed=seed))
    views = lab.choose_views(max(SAMPLES_N))
    clean, noisy = pictured(lab, views, 0.0), pictured(lab, views, RGB_LEVELS)
    shaky = told(lab.with_cfg(**KINEMATICS), clean)
    wrong = int(lab.rng.integers(min(SAMPLES_N)))
    bent = Laboratory(LabCfg(setup=setup, seed=seed, camera=Intrinsics(distortion=LENS), intrinsics_error=INEXACT))
    sets = {
        "clean": clean,
        "rgb_noise": noisy,
        "kinematics_noise": shaky,
        "wrong_sample": told(lab, clean, wrong),
        "inexact_camera": pictured(bent, bent.choose_views(max(SAMPLES_N)), RGB_LEVELS),
    }
    for condition, samples in sets.items():
        expected = [str(wrong)] if condition == "wrong_sample" else []
        for n in SAMPLES_N:
            yield run(lab, condition, samples[:n], expected)


def run(lab: Laboratory, condition: str, samples: list[Sample], outliers: list[str]) -> Run:
    """One calibration."""
    setup = lab.cfg.setup
    result = solve_hand_eye(samples, setup)
    X, _ = solve_closed_form(samples, setup)
    covers = result.uncertainty.covers(result.T_parent_cam, lab.X)
    return Run(
        setup,
        condition,
        len(samples),
        lab.cfg.seed,
        *_off(result.T_parent_cam, lab.X),
        *_off(X, lab.X),
        1e3 * distance_m(X, opencv(samples, setup)),
        coverage_of(samples).turn_deg,
        1e3 * result.uncertainty.translation_m,
        float(np.degrees(result.uncertainty.rotation_rad)),
        *covers,
        outliers_right=result.outliers == outliers,
    )


def opencv(samples: list[Sample], setup: Setup) -> Array:
    """OpenCV's solver of Daniilidis."""
    problem = Problem(samples, setup)
    parts = [(T[:, :3, :3], T[:, :3, 3]) for T in (problem.hand, problem.seen)]
    R, t = cv2.calibrateHandEye(*parts[0], *parts[1], method=cv2.CALIB_HAND_EYE_DANIILIDIS)
    return transform_from(R, np.ravel(t))


def _off(T: Array, truth: Array) -> tuple[float, float]:
    return 1e3 * distance_m(T, truth), float(np.degrees(angle_rad(T, truth)))


def row(runs: list[Run]) -> dict[str, object]:
    """One condition in a row."""

    def spread(name: str) -> str:
        return _spread([getattr(r, name) for r in runs])

    return {
        "setup": runs[0].setup,
        "condition": runs[0].condition,
        "samples": runs[0].samples_n,
        "runs": len(runs),
        "translation_mm": spread("translation_mm"),
        "rotation_deg": spread("rotation_deg"),
        "closed_form_mm": spread("closed_form_mm"),
        "closed_form_deg": spread("closed_form_deg"),
        "radius_mm": spread("radius_mm"),
        "radius_deg": spread("radius_deg"),
        "covered_translation": sum(r.covers_translation for r in runs),
        "covered_rotation": sum(r.covers_rotation for r in runs),
        "outliers_right": sum(r.outliers_right for r in runs),
    }


def equality(runs: list[Run]) -> dict[str, object]:
    """How often OpenCV's solver gives the same, and how far the hand turned where it does not."""
    other = [r for r in runs if not r.opencv_apart_mm <= EQUAL_MM]
    return {
        "name": "equal to OpenCV's solver",
        "runs": len(runs),
        "equal": len(runs) - len(other),
        "least_turn_of_others_deg": round(min(r.largest_turn_deg for r in other), 1) if other else None,
        "error_mm": _spread([r.closed_form_mm for r in other]) if other else None,
        "opencv_apart_mm": _spread([r.opencv_apart_mm for r in other]) if other else None,
    }


def _spread(values: list[float]) -> str:
    return f"{np.mean(values):.3f} ({np.max(values):.3f})"


def total(runs: list[Run], name: str) -> dict[str, object]:
    """How often the truth is covered, over all these runs."""
    counts = [
        Counts(sum(getattr(r, key) for r in runs), len(runs)) for key in ("covers_translation", "covers_rotation")
    ]
    return {
        "name": f"coverage, {name}",
        "runs": len(runs),
        **{
            key: f"{100 * c.rate:.1f} % ({100 * wilson_interval(c)[0]:.1f} to {100 * wilson_interval(c)[1]:.1f} %)"
            for key, c in zip(("translation", "rotation"), counts, strict=True)
        },
        "machine": machine(),
    }


def main() -> None:
    """Measure what is missing, then print all rows."""
    runs = kept_runs(__doc__, "calibration", 20, Run, runs_of)
    for setup in SETUPS:
        for condition in CONDITIONS:
            for n in SAMPLES_N:
                chosen = [r for r in runs if (r.setup, r.condition, r.samples_n) == (setup, condition, n)]
                print(json.dumps(row(chosen)), flush=True)
    for condition in CONDITIONS:
        print(json.dumps(total([r for r in runs if r.condition == condition], condition)), flush=True)
    print(json.dumps(total(runs, "everything")), flush=True)
    print(json.dumps(equality(runs)), flush=True)


if __name__ == "__main__":
    main()
