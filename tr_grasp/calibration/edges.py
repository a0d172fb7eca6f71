"""Corners of dark markers to a few hundredths of a pixel: a line along each side, then where the lines meet.

A corner finder looks at a small window, which near a printed gap of a few pixels holds the next marker too; a side has
dozens of pixels, and a strip of half a gap is enough for it.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from tr_grasp.calibration.rigid import Array

STEPS_PER_PX = 4


@dataclass(frozen=True, eq=False)
class Quads:
    """Refined corners (n, 4, 2) [px] and the width of each side's edge (n, 4): a standard deviation [px]."""

    corners_px: Array
    blur_px: Array


def refine_quads(grey: Array, corners_px: Array, reach_px: Array, rounds_n: int = 2) -> Quads:
    """Fit lines to the sides of dark quadrilaterals on white.

    Args:
        grey: (h, w) picture.
        corners_px: (n, 4, 2) corners to about a pixel, in order around.
        reach_px: (n,) how far to both sides of an edge nothing else is printed.
        rounds_n: How often lines are fitted, each time around those before.
    """
    picture = grey.astype(np.float32)
    corners = corners_px.astype(float).copy()
    blur = np.zeros((len(corners), 4))
    for i, reach in enumerate(np.clip(reach_px, 1.5, 6.0)):
        for _ in range(rounds_n):
            sides = [_side(picture, corners[i], side, float(reach)) for side in range(4)]
            blur[i] = [width for _, width in sides]
            lines = [line for line, _ in sides]
            # Corner k joins side k - 1, which ends there, and side k, which starts there.
            corners[i] = [_meeting(lines[k - 1], lines[k]) for k in range(4)]
    return Quads(corners, blur)


def _side(picture: Array, corners: Array, side: int, reach: float) -> tuple[Array, float]:
    """A homogeneous line (3,) along a side, and how wide its edge is."""
    start, end = corners[side], corners[(side + 1) % 4]
    along = end - start
    length = float(np.linalg.norm(along))
    along = along / max(length, 1e-9)
    outward = np.array([along[1], -along[0]])
    if outward @ (corners.mean(0) - start) > 0:
        outward = -outward
    # Near its ends a side is rounded by the blur of the other two.
    inset = min(2.5, 0.2 * length)
    at = np.linspace(inset, length - inset, max(int(length), 8))
    across = np.linspace(-reach, reach, int(2 * reach * STEPS_PER_PX) + 1)
    points = start + at[:, None, None] * along + across[None, :, None] * outward
    profile = cv2.remap(picture, *_maps(points), cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    ends = max(1, len(across) // 6)
    dark, bright = profile[:, :ends].mean(), profile[:, -ends:].mean()
    step = np.clip((profile - dark) / max(bright - dark, 1.0), -0.5, 1.5)
    # The area under a step says where it is, whatever blurs it evenly.
    area = (step.sum(1) - (step[:, 0] + step[:, -1]) / 2) * (across[1] - across[0])
    offset = reach - area
    edge = start + at[:, None] * along + offset[:, None] * outward
    return _line(edge), _width(step.mean(0), across)


def _maps(points: Array) -> tuple[Array, Array]:
    """Columns and rows as OpenCV's remap takes them."""
    return points[..., 0].astype(np.float32), points[..., 1].astype(np.float32)


def _line(points: Array) -> Array:
    """The line (3,) nearest to points (n, 2), those far from it left out once."""
    centre, normal = _plain_line(points)
    gaps = np.abs((points - centre) @ normal)
    near = points[gaps <= 3 * np.median(gaps) + 1e-6]
    centre, normal = _plain_line(near)
    return np.r_[normal, -normal @ centre]


def _plain_line(points: Array) -> tuple[Array, Array]:
    """A point on the line and its normal."""
    centre = points.mean(0)
    return centre, np.linalg.eigh((points - centre).T @ (points - centre))[1][:, 0]


def _meeting(first: Array, second: Array) -> Array:
    x, y, w = np.cross(first, second)
    return np.array([x, y]) / (w if abs(w) > 1e-12 else 1e-12)


def _width(step: Array, across: Array) -> float:
    """Standard deviation [px] of the blur that made a step: of its slope, taken as a density."""
    slope = np.maximum(np.gradient(step, across), 0.0)
    total = slope.sum()
    if total <= 0:
        return float(across[-1])
    middle = (slope * across).sum() / total
    return float(np.sqrt((slope * (across - middle) ** 2).sum() / total))
