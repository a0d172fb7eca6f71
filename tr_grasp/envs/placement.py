"""Where objects start before they are dropped."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tr_grasp.configs import ObjectsCfg, WorkspaceCfg
from tr_grasp.errors import ConfigError
from tr_grasp.objects import random_orientation

Array = NDArray[np.floating]


def drop_poses(
    diagonals_m: Array, objects: ObjectsCfg, workspace: WorkspaceCfg, rng: np.random.Generator
) -> list[tuple[Array, Array]]:
    """Position (3,) [m, base frame] and orientation (wxyz) from which each object is let go.

    Scattered objects start side by side, as far apart as room allows; piled ones start above each other near the
    middle. A ``mixed`` arrangement draws one of the two.

    Raises:
        ConfigError: The workspace is too small for so many objects side by side.
    """
    if objects.arrangement == "pile" or (objects.arrangement == "mixed" and rng.random() < 0.5):
        spots = [rng.uniform(-0.025, 0.025, 2) for _ in diagonals_m]
        heights = 0.5 * diagonals_m[0] + 0.02 + np.concatenate([[0.0], np.cumsum(diagonals_m[1:] * 0.8)])
    else:
        spots = _apart(len(diagonals_m), objects.spread / 2 * workspace.side_m, float(np.mean(diagonals_m)), rng)
        heights = 0.5 * diagonals_m + 0.01
    centre = np.array(workspace.centre_m[:2])
    return [
        (np.array([*(centre + spot), height]), random_orientation(objects.orientation, rng))
        for spot, height in zip(spots, heights, strict=True)
    ]


def _apart(count: int, half_side_m: float, diagonal_m: float, rng: np.random.Generator) -> list[Array]:
    """Points (2,) in a square, each as far from the others as a shrinking demand allows."""
    spots: list[Array] = []
    while len(spots) < count:
        distance = 0.16
        while True:
            spot = rng.uniform(-half_side_m, half_side_m, 2)
            if all(np.linalg.norm(spot - other) > distance for other in spots):
                break
            distance *= 0.95
            if distance < diagonal_m / 4:
                raise ConfigError(
                    f"{count} objects with a mean diagonal of {diagonal_m:.3f} m do not fit side by side into a square "
                    f"of {2 * half_side_m:.3f} m; choose fewer (objects.count_range), a larger objects.spread or "
                    "workspace.side_m, or objects.arrangement pile."
                )
        spots.append(spot)
    return spots


def all_inside(positions: Array, workspace: WorkspaceCfg, margin_m: float) -> bool:
    """Whether every position (n, 3) lies over the workspace's square, widened by ``margin_m``."""
    return bool(inside(positions, workspace, margin_m).all())


def inside(positions: Array, workspace: WorkspaceCfg, margin_m: float) -> NDArray[np.bool_]:
    """(n,) which positions (n, 3) lie over the workspace's square, widened by ``margin_m``, and not under the table."""
    offset = np.abs(positions[:, :2] - np.array(workspace.centre_m[:2]))
    return (offset <= workspace.side_m / 2 + margin_m).all(axis=1) & (positions[:, 2] > -0.05)
