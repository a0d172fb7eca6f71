"""Calibration from the ray caster's pictures and from SAPIEN's: ``python -m benchmarks.laboratory_eyes --out FOLDER``.

Needs a Vulkan device. Both eyes look at the same 11 views of the same laboratories (clean, 640 x 480, blur 0.6 px).
Prints a JSON row for each setup and eye: samples that were taken, how far corners are from where the truth has them,
and how far the calibration is off. Every laboratory is kept in FOLDER, so that a stopped measurement goes on.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from benchmarks._common import machine
from benchmarks._laboratories import kept_runs
from tr_grasp.calibration import (
    Eye,
    LabCfg,
    Laboratory,
    RaycastEye,
    Refused,
    Sample,
    Setup,
    detect_board,
    solve_hand_eye,
)
from tr_grasp.calibration.rigid import angle_rad, distance_m
from tr_grasp.calibration.samples import SETUPS
from tr_grasp.calibration.session import sample_of
from tr_grasp.calibration.views import View
from tr_grasp.envs.laboratory_eye import SapienEye

VIEWS_N = 11


@dataclass(frozen=True)
class Run:
    """One laboratory through one eye."""

    setup: Setup
    eye: str
    seed: int
    samples_n: int
    refused: list[str]
    corners_px: list[float]
    translation_mm: float
    rotation_deg: float
    picture_cpu_s: float


def runs_of(setup: Setup, seed: int, eyes: dict[str, Eye]) -> Iterator[Run]:
    """One laboratory through each eye."""
    cfg = LabCfg(setup=setup, seed=seed)
    views = Laboratory(cfg).choose_views(VIEWS_N)
    for name, eye in eyes.items():
        yield run(Laboratory(cfg, eye), name, views)


def run(lab: Laboratory, name: str, views: list[View]) -> Run:
    """One calibration."""
    samples: list[Sample] = []
    refused: list[str] = []
    corners_px: list[float] = []
    begun_s = time.process_time()
    shots = [lab.shoot(view) for view in views]
    picture_cpu_s = (time.process_time() - begun_s) / len(views)
    for i, shot in enumerate(shots):
        seen = detect_board(shot.picture, lab.cfg.board, lab.cfg.camera)
        if isinstance(seen, Refused):
            refused.append(f"{i}: {seen.reason.value}")
            continue
        truth = lab.T_cam_board(shot.T_base_tcp)
        expected = lab.cfg.camera.project(seen.points_board @ truth[:3, :3].T + truth[:3, 3])
        corners_px += np.linalg.norm(seen.pixels - expected, axis=1).tolist()
        samples.append(sample_of(str(i), shot.T_base_tcp, seen))
    X = solve_hand_eye(samples, lab.cfg.setup).T_parent_cam
    off_mm, off_deg = 1e3 * distance_m(X, lab.X), float(np.degrees(angle_rad(X, lab.X)))
    return Run(
        lab.cfg.setup, name, lab.cfg.seed, len(samples), refused, corners_px, off_mm, off_deg, round(picture_cpu_s, 2)
    )


def row(runs: list[Run]) -> dict[str, object]:
    """All laboratories of one setup through one eye."""
    corners = np.concatenate([r.corners_px for r in runs])
    off_mm, off_deg = (np.array([getattr(r, name) for r in runs]) for name in ("translation_mm", "rotation_deg"))
    return {
        "setup": runs[0].setup,
        "eye": runs[0].eye,
        "laboratories": len(runs),
        "samples": sum(r.samples_n for r in runs),
        "refused": [f"seed {r.seed}, view {reason}" for r in runs for reason in r.refused],
        "corners": len(corners),
        "corner_rms_px": round(float(np.sqrt((corners**2).mean())), 4),
        "corner_largest_px": round(float(corners.max()), 3),
        "translation_mm": f"{off_mm.mean():.3f} ({off_mm.max():.3f})",
        "rotation_deg": f"{off_deg.mean():.4f} ({off_deg.max():.4f})",
        "picture_cpu_s": round(float(np.median([r.picture_cpu_s for r in runs])), 2),
        "machine": machine(),
    }


def main() -> None:
    """Measure what is missing, then print all rows."""
    cfg = LabCfg()
    eyes: dict[str, Eye] = {"raycast": RaycastEye(cfg.board), "sapien": SapienEye(cfg.robot, cfg.board)}
    runs = kept_runs(__doc__, "laboratory_eyes", 5, Run, partial(runs_of, eyes=eyes))
    for setup in SETUPS:
        for name in eyes:
            print(json.dumps(row([r for r in runs if (r.setup, r.eye) == (setup, name)])), flush=True)


if __name__ == "__main__":
    main()
