"""An upright bottle of any size: body, shoulder and neck."""

from __future__ import annotations

import numpy as np
import trimesh

from tr_grasp.objects import shapes
from tr_grasp.objects.model import ObjectModel

BODY, SHOULDER, NECK_RADIUS = 0.72, 0.86, 0.42
"""Height at which body and shoulder end, as parts of the whole, and the neck's radius as a part of the body's."""
GREEN, CAP = (0.20, 0.48, 0.34), (0.85, 0.83, 0.78)


def bottle(radius_m: float, height_m: float) -> ObjectModel:
    """A bottle that stands along z; its origin is its centre of mass.

    Args:
        radius_m: Of its body.
        height_m: From foot to cap.
    """
    neck_m, heights = NECK_RADIUS * radius_m, np.array([0.0, BODY, SHOULDER, 1.0]) * height_m
    radii = [(radius_m, radius_m), (radius_m, neck_m), (neck_m, neck_m)]
    parts = [
        shapes.revolved([(low, float(heights[i])), (high, float(heights[i + 1]))])
        for i, (low, high) in enumerate(radii)
    ]
    offsets = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    faces = np.concatenate([part.faces + offset for part, offset in zip(parts, offsets, strict=True)])
    visual = trimesh.Trimesh(np.concatenate([part.vertices for part in parts]), faces, process=False)
    colours = np.concatenate([np.tile(c, (len(p.faces), 1)) for p, c in zip(parts, (GREEN, GREEN, CAP), strict=True)])
    return ObjectModel.assemble("bottle", "bottle", parts, visual, colours)
