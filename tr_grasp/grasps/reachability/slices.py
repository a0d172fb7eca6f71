"""A picture of a reachability field: upright slices through the base axis for several directions of the tool."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tr_grasp.grasps.reachability.field import ReachabilityField

Array = NDArray[np.floating]
_S = np.sqrt(0.5)
DIRECTIONS = {
    "tool points down": np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, -1]]),
    "obliquely down and outward": np.array([[_S, 0, _S], [0, -1, 0], [_S, 0, -_S]]),
    "outward": np.array([[0.0, 0, 1], [0, -1, 0], [1, 0, 0]]),
    "sideways": np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]]),
    "inward": np.array([[0.0, 0, -1], [0, 1, 0], [1, 0, 0]]),
    "up": np.eye(3),
}
"""Rotations of the tool at points of the xz plane, x being outward."""
LARGEST_M = 0.3


def slice_poses(field: ReachabilityField, R_base_tcp: Array, resolution_m: float) -> Array:
    """``T_base_tcp`` (rows, columns, 4, 4) on the xz plane of the field's domain, outward to the right, up upward."""
    domain = field.domain
    x = np.arange(0.0, domain.radius_m, resolution_m)
    z = np.arange(domain.low_m, domain.high_m, resolution_m)
    T = np.zeros((len(z), len(x), 4, 4))
    T[..., :3, :3], T[..., 0, 3], T[..., 2, 3], T[..., 3, 3] = R_base_tcp, x, z[:, None], 1.0
    return T


def draw_slices(field: ReachabilityField, path: str | Path, resolution_m: float = 0.01) -> Path:
    """Draw margins as colours, their zero as a line, into a PNG.

    Raises:
        OSError: It could not be written.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 7), layout="constrained")
    axes = figure.subplots(2, 3, sharex=True, sharey=True).ravel()
    domain, shades = field.domain, []
    extent = (0.0, domain.radius_m, domain.low_m, domain.high_m)
    for ax, (name, rotation) in zip(axes, DIRECTIONS.items(), strict=True):
        margins = field.values(slice_poses(field, rotation, resolution_m))
        shade = ax.imshow(margins, origin="lower", extent=extent, cmap="RdBu", vmin=-LARGEST_M, vmax=LARGEST_M)
        shades.append(shade)
        if margins.min() < 0 < margins.max():
            ax.contour(margins, [0.0], extent=extent, colors="black", linewidths=1.0)
        ax.axhline(0.0, color="grey", linewidth=0.8)
        ax.set_title(name)
    for ax in axes[3:]:
        ax.set_xlabel("distance from the base axis [m]")
    for ax in axes[::3]:
        ax.set_ylabel("height [m]")
    figure.colorbar(shades[-1], ax=list(axes), label="margin [m], reachable where positive")
    figure.suptitle(f"{field.robot}: where the tool can be")
    figure.savefig(Path(path), dpi=110)
    return Path(path)
