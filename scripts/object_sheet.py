"""Draw a contact sheet of a set of objects, each standing on the floor as modelled, all at one scale.

python scripts/object_sheet.py objects.png                          procedural objects, two of each training family
python scripts/object_sheet.py objects.png procedural test
python scripts/object_sheet.py objects.png path/to/household train  every object of a folder
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from tr_grasp.objects import ObjectModel, object_set
from tr_grasp.objects.sets import PROCEDURAL, PROCEDURAL_WIDE
from tr_grasp.sensing import Body, PinholeCamera, RaycastScene

TILE_PX, OVERSAMPLING, COLUMNS_N = 240, 3, 8
DRAWS_N = 4000
EYE_M, FOV_RAD = np.array([0.42, -0.36, 0.40]), 0.33
FLOOR_COLOUR, SKY_COLOUR = (0.80, 0.80, 0.79), (0.96, 0.97, 0.98)
ROOM_ABOVE_M = 0.015
SUN = np.array([0.45, -0.35, 0.82])


def sheet(source: str, split: str) -> Image.Image:
    """A tile for each object, with its name, extents [mm] and number of convex parts."""
    models = chosen_models(source, split)
    rows_n = -(-len(models) // COLUMNS_N)
    picture = Image.new("RGB", (COLUMNS_N * TILE_PX, rows_n * TILE_PX), (255, 255, 255))
    draw, font = ImageDraw.Draw(picture), ImageFont.load_default(size=13)
    for index, model in enumerate(models):
        corner = (index % COLUMNS_N * TILE_PX, index // COLUMNS_N * TILE_PX)
        picture.paste(Image.fromarray(draw_object(model)), corner)
        size = " x ".join(f"{1000 * extent:.0f}" for extent in model.extents_m)
        caption = f"{model.family}\n{size} mm, {len(model.parts)} part{'s' * (len(model.parts) > 1)}"
        draw.text((corner[0] + 8, corner[1] + 6), caption, fill=(30, 30, 30), font=font)
    return picture


def chosen_models(source: str, split: str) -> list[ObjectModel]:
    """One model of each object of a folder, or two of each procedural family, in the order of the set's names."""
    objects, rng = object_set(source, split, overlap="leave_out"), np.random.default_rng(0)
    each_n = 2 if source in (PROCEDURAL, PROCEDURAL_WIDE) else 1
    found: dict[str, list[ObjectModel]] = {name: [] for name in objects.names}
    for _ in range(DRAWS_N):
        model = objects.sample(rng)
        if len(found[model.family]) < each_n:
            found[model.family].append(model)
        if all(len(models) == each_n for models in found.values()):
            break
    return [model for models in found.values() for model in models]


def draw_object(model: ObjectModel) -> NDArray[np.uint8]:
    """A shaded (TILE_PX, TILE_PX, 3) picture of an object on the floor."""
    floor = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float)
    visual = Body(model.visual.vertices, model.visual.faces, model.face_colours)
    scene = RaycastScene([visual], [Body.uniform(floor, [[0, 1, 2], [0, 2, 3]], FLOOR_COLOUR)])
    centre = -model.visual.bounds.mean(axis=0)
    centre[2] = -model.visual.bounds[0, 2]
    T_base_obj = np.eye(4)
    T_base_obj[:3, 3] = centre
    # A little above the middle of the object, to leave room for the caption.
    middle = np.array([0.0, 0.0, model.extents_m[2] / 2 + ROOM_ABOVE_M])
    camera = PinholeCamera.looking_at(middle + EYE_M, middle, FOV_RAD, TILE_PX * OVERSAMPLING)
    return _shaded(scene, T_base_obj[None], camera.rays_base)


def _shaded(scene: RaycastScene, poses: NDArray, rays: NDArray[np.float32]) -> NDArray[np.uint8]:
    hits = scene.cast(rays, poses)
    seen = hits.body >= 0
    # Faces that are seen from behind are drawn red: their winding is wrong.
    behind = (hits.normals * rays[:, 3:]).sum(axis=1) > 0
    points = rays[:, :3] + rays[:, 3:] * np.where(seen, hits.distance, 0.0)[:, None]
    to_sun = np.concatenate([points + 1e-4 * hits.normals, np.broadcast_to(SUN, points.shape)], axis=1)
    lit = ~np.isfinite(scene.cast(to_sun.astype(np.float32), poses).distance)
    diffuse = np.clip(hits.normals @ SUN, 0, 1) * np.where(lit, 1.0, 0.2)
    colour = hits.colours * (0.50 + 0.18 * hits.normals[:, 2:] + 0.45 * diffuse[:, None])
    colour = np.where((seen & behind)[:, None], (0.9, 0.0, 0.0), np.where(seen[:, None], colour, SKY_COLOUR))
    blocks = np.clip(colour, 0, 1).reshape(TILE_PX, OVERSAMPLING, TILE_PX, OVERSAMPLING, 3)
    return (255 * blocks.mean(axis=(1, 3))).astype(np.uint8)


if __name__ == "__main__":
    if not 2 <= len(sys.argv) <= 4:
        sys.exit(__doc__)
    source = sys.argv[2] if len(sys.argv) > 2 else PROCEDURAL
    split = sys.argv[3] if len(sys.argv) > 3 else "train"
    sheet(source, split).save(Path(sys.argv[1]))
