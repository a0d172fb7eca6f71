"""Where the upright object stands, from one depth picture of a camera whose place is known."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from tr_grasp.geometry import transform_points
from tr_grasp.hardware import RGBDImage
from tr_grasp.pick_place.station import StationCfg

Array = NDArray[np.floating]
LEAST_POINTS = 40
BODY_PART = (0.1, 0.65)
"""Part of the height in which the object is as wide as its body."""
FIT_ERROR_M = 0.006
ROBUST_M = 0.003


def points_of(image: RGBDImage, T_base_cam: Array) -> Array:
    """(n, 3) what a picture shows, base frame [m]."""
    k, rows_columns = image.intrinsics, np.argwhere(np.isfinite(image.depth_m))
    depth = image.depth_m[tuple(rows_columns.T)].astype(float)
    rays = np.column_stack(
        [(rows_columns[:, 1] - k.cx) / k.fx, (rows_columns[:, 0] - k.cy) / k.fy, np.ones(len(depth))]
    )
    return transform_points(T_base_cam, rays * depth[:, None])


def find_object(image: RGBDImage, T_base_cam: Array, cfg: StationCfg) -> tuple[float, float] | str:
    """The foot (x, y) of the object, or why it was not found.

    A circle of the object's radius is fitted to what stands in ``cfg.search_m`` at the height of its body, so that a
    camera that sees one side of it knows where its middle is.

    Args:
        image: The picture; nothing else may stand in the searched region.
        T_base_cam: (4, 4) where the camera is, from a calibration.
        cfg: The station.
    """
    if cfg.search_m is None:
        return "the station has no search_m, the region in which to look"
    o, points = cfg.object, points_of(image, T_base_cam)
    low, high = np.array(cfg.search_m[0]), np.array(cfg.search_m[1])
    heights = o.foot_m[2] + o.height_m * np.array(BODY_PART)
    inside = ((points >= low) & (points <= high)).all(axis=1)
    body = points[inside & (points[:, 2] > heights[0]) & (points[:, 2] < heights[1]), :2]
    if len(body) < LEAST_POINTS:
        return f"{len(body)} points stand where to look; {LEAST_POINTS} are needed"
    away = body.mean(axis=0) - T_base_cam[:2, 3]
    start = body.mean(axis=0) + o.radius_m / 2 * away / np.linalg.norm(away)

    def errors(centre: Array) -> Array:
        return np.linalg.norm(body - centre, axis=1) - o.radius_m

    fit = least_squares(errors, start, loss="soft_l1", f_scale=ROBUST_M)
    if (error := float(np.median(np.abs(errors(fit.x))))) > FIT_ERROR_M:
        return f"what stands there is no cylinder of radius {o.radius_m:g} m: it is {1e3 * error:.0f} mm off"
    return float(fit.x[0]), float(fit.x[1])
