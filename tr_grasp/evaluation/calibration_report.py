"""The report of a hand-eye calibration: one HTML file that needs nothing beside it."""

from __future__ import annotations

from html import escape

import cv2
import imageio.v3 as imageio
import numpy as np

from tr_grasp.calibration.interchange import record_of, static_transform
from tr_grasp.calibration.overlay import draw_overlay, expected_error_px
from tr_grasp.calibration.problem import Problem
from tr_grasp.calibration.rigid import Array, angle_rad, distance_m
from tr_grasp.calibration.samples import Sample
from tr_grasp.calibration.session import HandEyeSession
from tr_grasp.calibration.solve import HandEyeResult, SampleError
from tr_grasp.evaluation import page
from tr_grasp.geometry import wxyz_from_matrix
from tr_grasp.provenance import Provenance

SAMPLE_COLUMNS = ("sample", "off [mm]", "off [deg]", "held out [mm]", "held out [deg]", "corners [px]", "")
JPEG_QUALITY = 82


def calibration_html(
    session: HandEyeSession, result: HandEyeResult, provenance: Provenance, truth: Array | None = None
) -> str:
    """The report as one HTML page.

    Args:
        session: Where the samples are.
        result: What was found.
        provenance: Where it comes from.
        truth: (4, 4) where the camera truly is, if it was simulated.
    """
    expected = Problem(session.samples, session.cfg.setup).expected(result.T_parent_cam, result.T_parent_board)
    where = "beside the robot" if result.setup == "eye_on_base" else "in the hand"
    sections = [_header(f"Hand-eye calibration, camera {where}", result, truth)]
    if result.warnings:
        items = "".join(f"<li>{escape(sentence)}</li>" for sentence in result.warnings)
        sections.append(page.section("To look at", page.card(f"<ul>{items}</ul>")))
    sections.append(page.section(result.name, page.card(page.facts(_facts(session, result)))))
    rows = [_row(s, e, T, session) for s, e, T in zip(session.samples, result.samples, expected, strict=True)]
    sections.append(page.section("Samples", page.card(page.table(SAMPLE_COLUMNS, rows))))
    pictures = [_picture(session, s, e, T) for s, e, T in zip(session.samples, result.samples, expected, strict=True)]
    if any(pictures):
        note = (
            '<p class="lead">Green circles: corners as the camera saw them. Red: the board and its corners where the '
            "calibration expects them. Short lines: the board's x (red), y (green) and z (blue).</p>"
        )
        sections.append(page.section("Pictures", note, page.grid(filter(None, pictures))))
    sections.append(page.section("How to get the same", page.card(page.facts(_source(provenance)))))
    return page.page("Hand-eye calibration", sections)


def _header(title: str, result: HandEyeResult, truth: Array | None) -> str:
    radius, turned = 1e3 * result.uncertainty.translation_m, np.degrees(result.uncertainty.rotation_rad)
    sentence = (
        "With 95 % confidence, and if its intrinsics are right, the camera is within "
        f"{radius:.2f} mm and {turned:.3f} degrees of {result.name}, "
        f"from {len(result.samples)} samples"
    )
    sentence += f", {len(result.outliers)} of them left out." if result.outliers else "."
    if truth is not None:
        sentence += (
            f" The truth of this simulation is {1e3 * distance_m(result.T_parent_cam, truth):.2f} mm and "
            f"{np.degrees(angle_rad(result.T_parent_cam, truth)):.3f} degrees away."
        )
    return f'<header><h1>{escape(title)}</h1><p class="lead">{escape(sentence)}</p></header>'


def _facts(session: HandEyeSession, result: HandEyeResult) -> list[tuple[str, str]]:
    T, frames = result.T_parent_cam, session.cfg.frames
    coverage, noise = result.coverage, result.noise
    facts = [
        ("position [m]", ", ".join(f"{v:.5f}" for v in T[:3, 3])),
        ("quaternion w, x, y, z", ", ".join(f"{v:.6f}" for v in wxyz_from_matrix(T[:3, :3]))),
        ("static transform", static_transform(record_of(result, frames))),
        ("method", f"{result.method}, {'then refined on all corners' if result.refined else 'not refined'}"),
        (
            "held-out error",
            "too few samples to leave one out"
            if result.held_out_m is None
            else f"{1e3 * result.held_out_m:.2f} mm, {np.degrees(result.held_out_rad or 0.0):.3f} degrees on average",
        ),
        (
            "noise found",
            f"corners {noise.pixel_px:.3f} px, robot {1e3 * noise.position_m:.2f} mm and "
            f"{np.degrees(noise.rotation_rad):.3f} degrees (standard deviations along each axis)",
        ),
        ("size of the board", f"{result.board_scale:.4f} ± {result.board_scale_error:.4f} of what was said"),
        (
            "motion",
            f"turned by up to {coverage.turn_deg:.0f} degrees about axes that spread by {coverage.spread_deg:.0f}, "
            f"moved by up to {coverage.way_m:.2f} m",
        ),
        ("board", session.cfg.board.words),
    ]
    return facts


def _row(sample: Sample, error: SampleError, T: Array, session: HandEyeSession) -> tuple[str, ...]:
    pixels = expected_error_px(sample, T, session.cfg.camera)
    return (
        sample.name,
        f"{1e3 * error.translation_m:.2f}",
        f"{np.degrees(error.rotation_rad):.3f}",
        "-" if error.held_out_m is None else f"{1e3 * error.held_out_m:.2f}",
        "-" if error.held_out_rad is None else f"{np.degrees(error.held_out_rad):.3f}",
        "-" if pixels is None else f"{pixels:.2f}",
        '<strong class="bad">left out</strong>' if error.outlier else "",
    )


def _picture(session: HandEyeSession, sample: Sample, error: SampleError, T: Array) -> str:
    path = session.picture_path(sample)
    if not path.is_file():
        return ""
    shown = draw_overlay(imageio.imread(path), sample, T, session.cfg.board, session.cfg.camera)
    _, jpeg = cv2.imencode(".jpg", shown[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    word = ' · <strong class="bad">left out</strong>' if error.outlier else ""
    caption = (
        f"sample {escape(sample.name)}: {1e3 * error.translation_m:.2f} mm, "
        f"{np.degrees(error.rotation_rad):.3f} degrees{word}"
    )
    image = f'<img alt="sample {escape(sample.name)}" src="{page.data_url(jpeg.tobytes(), "image/jpeg")}">'
    return page.card(f"<figure>{image}<figcaption>{caption}</figcaption></figure>")


def _source(provenance: Provenance) -> list[tuple[str, str]]:
    return [
        ("command", provenance.command),
        ("commit", provenance.commit or "none: not run from a committed source tree"),
        ("machine", provenance.machine),
        ("versions", ", ".join(f"{name} {version}" for name, version in provenance.versions.items())),
        ("started", provenance.started),
    ]
