"""Pictures of a pick-and-place station for people: one for each stage, or a film."""

from __future__ import annotations

import io

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from tr_grasp.envs.picture import picture
from tr_grasp.envs.sapien_station import SapienStation
from tr_grasp.pick_place import StationCfg
from tr_grasp.sensing import PinholeCamera

Picture = NDArray[np.uint8]
FOV_RAD = 0.62
AWAY = np.array([0.75, 0.85, 0.55])
"""Direction from the middle of the station to whoever looks."""
COLUMNS = 3
GAP_PX, LABEL_PX = 4, 16
INK, PAPER = (28, 37, 52), 255


def view_camera(cfg: StationCfg, size_px: int = 300) -> PinholeCamera:
    """From where the whole station can be seen: base, object and goal."""
    goal = np.mean(cfg.goal_m, axis=0) if cfg.goal_m is not None else np.array(cfg.object.foot_m)
    points = np.stack([np.array([0.0, 0.0, 0.5]), np.array(cfg.object.foot_m), goal])
    middle = points.mean(axis=0)
    reach = float(np.linalg.norm(points - middle, axis=1).max()) + 0.30
    eye = middle + AWAY / np.linalg.norm(AWAY) * reach / np.tan(FOV_RAD / 2)
    return PinholeCamera.looking_at(eye, middle, FOV_RAD, size_px)


def snapshot(station: SapienStation, camera: PinholeCamera) -> Picture:
    """A shaded (h, w, 3) picture of the present instant; the station has a camera of its own."""
    assert station.camera is not None, "a station without a camera keeps no shapes to draw"
    return picture(station.camera.scene, station.camera.poses(), camera.height_px, camera=camera)


def strip_of(pictures: list[tuple[str, Picture]]) -> bytes:
    """Pictures with their names, three in a row, as PNG."""
    size = pictures[0][1].shape[0]
    rows = -(-len(pictures) // COLUMNS)
    height, width = rows * (size + LABEL_PX + GAP_PX), COLUMNS * (size + GAP_PX)
    sheet = Image.fromarray(np.full((height, width, 3), PAPER, np.uint8))
    pen, font = ImageDraw.Draw(sheet), ImageFont.load_default()
    for i, (name, shown) in enumerate(pictures):
        x, y = i % COLUMNS * (size + GAP_PX), i // COLUMNS * (size + LABEL_PX + GAP_PX)
        pen.text((x + 4, y + 2), f"{i + 1}  {name}", fill=INK, font=font)
        sheet.paste(Image.fromarray(shown), (x, y + LABEL_PX))
    stream = io.BytesIO()
    sheet.save(stream, "PNG", optimize=True)
    return stream.getvalue()
