"""Did the hand move enough, and about different axes? If not, what is missing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.spatial.transform import Rotation

from tr_grasp.calibration.rigid import Array
from tr_grasp.calibration.samples import Sample, base_tcp
from tr_grasp.errors import CalibrationError

LEAST_SAMPLES = 3
GOOD_SAMPLES = 10
LEAST_TURN_DEG, GOOD_TURN_DEG = 10.0, 30.0
LEAST_SPREAD_DEG, GOOD_SPREAD_DEG = 10.0, 25.0
GOOD_WAY_M = 0.10


@dataclass(frozen=True)
class Coverage:
    """How the hand moved between samples."""

    samples_n: int
    """Number of samples."""

    turn_deg: float
    """Largest rotation between two samples."""

    spread_deg: float
    """How far the axes of rotation are from being parallel, root mean square, at most 90."""

    way_m: float
    """Largest distance between two positions of the hand."""

    turns_deg: tuple[float, float, float]
    """Range of rotation about the hand's own x, y and z."""

    @property
    def missing(self) -> list[str]:
        """What still has to be moved, a sentence each; empty when the set is good."""
        found = []
        if self.samples_n < GOOD_SAMPLES:
            found.append(f"take {GOOD_SAMPLES - self.samples_n} more; {GOOD_SAMPLES} to 15 samples are good.")
        if self.turn_deg < GOOD_TURN_DEG:
            found.append(
                f"turn the hand by {GOOD_TURN_DEG:.0f} degrees or more; so far by {self.turn_deg:.0f} at most."
            )
        weakest = int(np.argmin(self.turns_deg))
        if self.spread_deg < GOOD_SPREAD_DEG or self.turns_deg[weakest] < GOOD_TURN_DEG / 2:
            found.append(
                f"turn the hand about its {'xyz'[weakest]} axis, so far by {self.turns_deg[weakest]:.0f} degrees; "
                "two directions that are not parallel are needed, three are better."
            )
        if self.way_m < GOOD_WAY_M:
            found.append(f"move the hand by {GOOD_WAY_M:g} m or more; so far by {self.way_m:.2f} m at most.")
        return found

    @property
    def degenerate(self) -> str | None:
        """Why no calibration can come of this set, in one sentence; nothing if one can."""
        if self.samples_n < LEAST_SAMPLES:
            return f"too few samples: {LEAST_SAMPLES} are the least, 10 to 15 are good, got {self.samples_n}."
        if self.turn_deg < LEAST_TURN_DEG:
            return (
                f"the hand was turned by {self.turn_deg:.1f} degrees at most, {LEAST_TURN_DEG:.0f} are the least; "
                f"where the camera is does not follow from moving without turning."
            )
        if self.spread_deg < LEAST_SPREAD_DEG:
            return (
                f"all rotations are about parallel axes (within {self.spread_deg:.1f} degrees, "
                f"{LEAST_SPREAD_DEG:.0f} are the least), so where the camera is along them stays unknown; "
                f"turn the hand about another axis too."
            )
        return None


def coverage_of(samples: Sequence[Sample]) -> Coverage:
    """How the hand moved between samples."""
    T = base_tcp(samples)
    if len(T) < 2:
        return Coverage(len(T), 0.0, 0.0, 0.0, (0.0, 0.0, 0.0))
    pairs = list(combinations(range(len(T)), 2))
    turns = Rotation.from_matrix([T[i, :3, :3].T @ T[j, :3, :3] for i, j in pairs]).as_rotvec()
    way = max(float(np.linalg.norm(T[i, :3, 3] - T[j, :3, 3])) for i, j in pairs)
    middle = Rotation.from_matrix(T[:, :3, :3]).mean()
    own = (middle.inv() * Rotation.from_matrix(T[:, :3, :3])).as_rotvec()
    ranges = np.degrees(np.ptp(own, axis=0))
    largest = float(np.degrees(np.linalg.norm(turns, axis=1).max()))
    x, y, z = (float(r) for r in ranges)
    return Coverage(len(T), largest, _spread_deg(turns), way, (x, y, z))


def require_coverage(samples: Sequence[Sample]) -> Coverage:
    """As :func:`coverage_of`.

    Raises:
        CalibrationError: Nothing can be computed from these samples.
    """
    coverage = coverage_of(samples)
    if coverage.degenerate:
        raise CalibrationError(coverage.degenerate)
    return coverage


def _spread_deg(turns: Array) -> float:
    """Root mean square angle of rotation axes (n, 3), long turns weighing more, to the line they are nearest to."""
    # A turn's sine weights it: small turns have axes of noise, and turns near pi have one that flips its sign.
    angles = np.linalg.norm(turns, axis=1, keepdims=True)
    axes = turns / np.maximum(angles, 1e-12) * np.sin(np.minimum(angles, np.pi / 2))
    values = np.linalg.eigvalsh(axes.T @ axes)
    if values.sum() < 1e-12:
        return 0.0
    off = float(np.clip((values[0] + values[1]) / values.sum(), 0.0, 1.0))
    return float(np.degrees(np.arcsin(np.sqrt(off))))
