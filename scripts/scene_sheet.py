"""A contact sheet of ten randomised scenes, and of the depth camera without noise, with Gaussian and with stereo noise.

    python scripts/scene_sheet.py scenes.png

Above: a scene a tile, everything randomised, and what the policy's camera sees of it. Below: depth of three of them,
and how far it is off; where the camera measures nothing is black.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from tr_grasp.configs import CameraCfg, EnvCfg, RandomisationCfg
from tr_grasp.envs import make_env
from tr_grasp.envs.scene_view import SceneView
from tr_grasp.sensing import DepthImage, PinholeCamera, RaycastCamera
from tr_grasp.sensing.noise import with_depth_noise

SCENES_N, COLUMNS, TILE_PX, INSET_PX, GAP_PX, CAPTION_PX = 10, 5, 340, 128, 8, 24
DEPTH_SCENES, DEPTH_PX, ERROR_M = (0, 3, 8), 336, 0.005
NOISES = ("none", "gaussian", "stereo")
Picture = NDArray[np.uint8]


@dataclass(frozen=True)
class Shot:
    """One scene: as people and as the policy's camera see it, and its true depth."""

    overview: Picture
    seen: Picture
    depth: DepthImage
    camera: PinholeCamera
    caption: str


def shots() -> Iterator[Shot]:
    """Ten scenes with every randomiser on."""
    switches = {each.name: True for each in fields(RandomisationCfg)} | {"depth_noise": "none"}
    env = make_env(EnvCfg(randomise=RandomisationCfg(**switches)), seed=0)
    for _ in range(SCENES_N):
        env.reset()
        view, task = env.task.view, env.task
        gravity = -float(task.scene.px.config.gravity[2])
        latency_ms = 1000 * task.controller.delay_substeps / task.cfg.physics_hz
        image = look_from(view, replace(view.camera, width_px=DEPTH_PX, height_px=DEPTH_PX))
        yield Shot(
            view.picture(TILE_PX),
            (255 * np.clip(look_from(view, view.camera).colour, 0, 1)).astype(np.uint8),
            image,
            replace(view.camera, width_px=DEPTH_PX, height_px=DEPTH_PX),
            f"objects: {len(task.models)}, g {gravity:.3f}, {latency_ms:.0f} ms late",
        )
    env.close()


def look_from(view: SceneView, camera: PinholeCamera) -> DepthImage:
    """A noise-free picture of everything."""
    return RaycastCamera(view.raycast, camera, look=view.look).capture(view.poses())


def scene_tile(shot: Shot) -> Image.Image:
    """The overview with the camera's picture in its corner."""
    tile = captioned(Image.fromarray(shot.overview), shot.caption)
    inset = Image.fromarray(shot.seen).resize((INSET_PX, INSET_PX), Image.Resampling.NEAREST)
    corner = (TILE_PX - INSET_PX - 4, CAPTION_PX + 4)
    ImageDraw.Draw(tile).rectangle([corner[0] - 2, corner[1] - 2, TILE_PX - 3, CAPTION_PX + INSET_PX + 5], fill="white")
    tile.paste(inset, corner)
    return tile


def depth_tiles(shot: Shot) -> Iterator[Image.Image]:
    """Depth without noise, then depth and error with each noise."""
    true = shot.depth.depth
    near, far = np.quantile(true[np.isfinite(true)], [0.01, 0.99])
    for noise in NOISES:
        measured = with_depth_noise(noise, shot.depth, shot.camera, CameraCfg(), np.random.default_rng(0)).depth
        lost = ~np.isfinite(measured)
        range_m = f"{near:.2f} to {far:.2f} m"
        yield captioned(coloured((measured - near) / (far - near), "viridis", lost), f"depth, {noise}, {range_m}")
        if noise == "none":
            continue
        error = np.where(lost, 0.0, measured - true)
        rms_mm = 1000 * np.sqrt((error[~lost] ** 2).mean())
        text = f"error, ±{1000 * ERROR_M:.0f} mm; rms {rms_mm:.1f} mm, {lost[np.isfinite(true)].mean():.0%} lost"
        yield captioned(coloured(0.5 + error / (2 * ERROR_M), "RdBu", lost), text)


def coloured(values: NDArray, colours: str, lost: NDArray[np.bool_]) -> Image.Image:
    """Values in [0, 1] as colours; black where lost."""
    rgb = colormaps[colours](np.where(lost, 0.0, np.clip(values, 0, 1)))[..., :3]
    return Image.fromarray((255 * np.where(lost[..., None], 0.0, rgb)).astype(np.uint8))


def captioned(picture: Image.Image, text: str) -> Image.Image:
    """A square tile with a line of text above its picture."""
    tile = Image.new("RGB", (TILE_PX, TILE_PX + CAPTION_PX), "white")
    tile.paste(picture.resize((TILE_PX, TILE_PX), Image.Resampling.NEAREST), (0, CAPTION_PX))
    ImageDraw.Draw(tile).text((2, 4), text, fill="black", font=ImageFont.load_default(14))
    return tile


def sheet() -> Image.Image:
    """All of it."""
    scenes = list(shots())
    tiles = [scene_tile(shot) for shot in scenes]
    tiles += [tile for index in DEPTH_SCENES for tile in depth_tiles(scenes[index])]
    step_x, step_y = TILE_PX + GAP_PX, TILE_PX + CAPTION_PX + GAP_PX
    rows_n = -(-len(tiles) // COLUMNS)
    whole = Image.new("RGB", (COLUMNS * step_x - GAP_PX, rows_n * step_y - GAP_PX), "white")
    for index, tile in enumerate(tiles):
        whole.paste(tile, (index % COLUMNS * step_x, index // COLUMNS * step_y))
    return whole


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    sheet().save(Path(sys.argv[1]))
