"""Pictures of a board as a colour camera takes them: anti-aliased, blurred, noisy. No simulator."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import cv2
import numpy as np

from tr_grasp.calibration.board import BoardSpec
from tr_grasp.calibration.intrinsics import Intrinsics
from tr_grasp.calibration.rigid import Array
from tr_grasp.errors import CalibrationError
from tr_grasp.geometry import invert_transform

TEXELS_PER_M = 8000.0
SUBPIXELS = 4
INK, PAPER = 25.0, 225.0


@dataclass(frozen=True)
class ImageNoise:
    """What a real colour camera adds to an ideal one; grey levels are out of 255."""

    blur_px: float = 0.6
    """Standard deviation of the blur of the lens, beside that of the pixels themselves."""

    levels: float = 0.0
    """Standard deviation of each pixel's noise."""


def render_board(
    board: BoardSpec,
    T_cam_board: Array,
    camera: Intrinsics,
    noise: ImageNoise | None = None,
    rng: np.random.Generator | None = None,
) -> Array:
    """A picture (h, w, 3) uint8 RGB of a board before a plain wall.

    Pixels are averaged over 4 x 4 rays, each of which meets the board's plane exactly, through a lens that bends as the
    camera's distortion says.

    Args:
        board: What is shown.
        T_cam_board: (4, 4) where it is.
        camera: The camera.
        noise: Blur and noise of the camera.
        rng: Needed where there is noise.

    Raises:
        CalibrationError: Noise without a generator.
    """
    return exposed(board_picture(board, T_cam_board, camera), noise, rng)


def board_picture(board: BoardSpec, T_cam_board: Array, camera: Intrinsics) -> Array:
    """The same (h, w, 3) float32 in levels out of 255, as a camera without blur and noise sees it."""
    picture = _wall(camera.height_px, camera.width_px).copy()
    if T_cam_board[2, 2] > 0:  # else it shows its white back, which nobody looks at
        _paint(picture, board, T_cam_board, camera)
    return picture[..., None] * np.array([1.0, 0.985, 0.96], np.float32)


def exposed(picture: Array, noise: ImageNoise | None = None, rng: np.random.Generator | None = None) -> Array:
    """What a camera makes of an ideal picture (h, w, 3): blurred, noisy, in 256 levels (uint8).

    Raises:
        CalibrationError: Noise without a generator.
    """
    noise = noise or ImageNoise()
    if noise.blur_px > 0:
        picture = cv2.GaussianBlur(picture, (0, 0), noise.blur_px, borderType=cv2.BORDER_REPLICATE)
    if noise.levels > 0:
        if rng is None:
            raise CalibrationError("noise needs a random generator: rng.")
        picture = picture + noise.levels * rng.standard_normal(picture.shape, np.float32)
    return np.clip(np.rint(picture), 0, 255).astype(np.uint8)


class Eye(Protocol):
    """What takes the pictures of a laboratory, as a camera without blur and noise would."""

    def picture(self, camera: Intrinsics, T_base_cam: Array, T_base_board: Array, q_rad: Array) -> Array:
        """(h, w, 3) levels out of 255, where camera and board are and with the arm's joints at (dof,)."""
        ...


@dataclass(frozen=True)
class RaycastEye:
    """Sees the board before a wall and nothing else; needs no simulator and no graphics driver."""

    board: BoardSpec

    def picture(self, camera: Intrinsics, T_base_cam: Array, T_base_board: Array, q_rad: Array) -> Array:
        """The arm is not in the picture."""
        del q_rad
        return board_picture(self.board, invert_transform(T_base_cam) @ T_base_board, camera)


def _paint(picture: Array, board: BoardSpec, T: Array, camera: Intrinsics) -> None:
    outline = board.outline_board @ T[:3, :3].T + T[:3, 3]
    if (outline[:, 2] < 0.05).any():
        return
    pixels = camera.project(_edge_points(outline))
    low = np.maximum(np.floor(pixels.min(0)).astype(int) - 1, 0)
    high = np.minimum(np.ceil(pixels.max(0)).astype(int) + 2, [camera.width_px, camera.height_px])
    if (high <= low).any():
        return
    margin = board.margin_m
    to_texel = np.array(
        [[TEXELS_PER_M, 0, TEXELS_PER_M * margin - 0.5], [0, TEXELS_PER_M, TEXELS_PER_M * margin - 0.5], [0, 0, 1]]
    )
    x, y, w = np.moveaxis(
        subpixel_directions(camera, low, high) @ (to_texel @ np.linalg.inv(T[:3, [0, 1, 3]])).T, -1, 0
    )
    texture = _texture(board)
    columns, rows = (x / w).astype(np.float32), (y / w).astype(np.float32)
    ink = cv2.remap(texture, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    on_board = (columns > -0.5) & (columns < texture.shape[1] - 0.5) & (rows > -0.5) & (rows < texture.shape[0] - 0.5)
    small = (int(high[0] - low[0]), int(high[1] - low[1]))
    there = cv2.resize(on_board.astype(np.float32), small, interpolation=cv2.INTER_AREA)
    colour = cv2.resize(ink, small, interpolation=cv2.INTER_AREA)
    window = picture[low[1] : high[1], low[0] : high[0]]
    window[:] = there * colour * _light(T) + (1 - there) * window


def _edge_points(outline: Array) -> Array:
    """Points along the edges of a quadrilateral (4, 3): a lens bends them between its corners."""
    share = np.linspace(0, 1, 9)[:, None]
    return np.concatenate(
        [(1 - share) * a + share * b for a, b in zip(outline, np.roll(outline, -1, axis=0), strict=True)]
    )


def subpixel_directions(camera: Intrinsics, low: Array, high: Array) -> Array:
    """(rows, columns, 3) directions with z = 1 of the rays through a window of pixels, ``SUBPIXELS``² for each.

    Args:
        camera: With its lens.
        low: (2,) first column and row.
        high: (2,) those after the last.
    """
    # A lens bends so evenly that its directions are known at whole pixels and linear between them.
    u, v = (np.arange(low[k] - 1.0, high[k] + 1.0) for k in range(2))
    pixels = np.stack(np.meshgrid(u, v), axis=-1)
    directions = cv2.undistortPoints(pixels.reshape(-1, 1, 2), camera.matrix, camera.coefficients).reshape(pixels.shape)
    fine = cv2.resize(directions, None, fx=SUBPIXELS, fy=SUBPIXELS, interpolation=cv2.INTER_LINEAR)
    inside = fine[SUBPIXELS:-SUBPIXELS, SUBPIXELS:-SUBPIXELS]
    return np.concatenate([inside, np.ones((*inside.shape[:2], 1))], axis=2)


def _light(T_cam_board: Array) -> float:
    """Brighter where it faces the camera."""
    return 0.75 + 0.25 * float(T_cam_board[2, 2])


@lru_cache(maxsize=4)
def _texture(board: BoardSpec) -> Array:
    """Brightness of the board, each texel the exact share of ink and paper in it."""
    (w, h), m = board.size_m, board.margin_m
    shape = (round((h + 2 * m) * TEXELS_PER_M), round((w + 2 * m) * TEXELS_PER_M))
    ink = np.zeros(shape, np.float32)
    for left, top, right, bottom in (board.black_board + m) * TEXELS_PER_M:
        rows, columns = _shares(top, bottom), _shares(left, right)
        y, x = int(top), int(left)
        part = ink[y : y + len(rows), x : x + len(columns)]
        part += np.outer(rows, columns)[: part.shape[0], : part.shape[1]]
    return (PAPER + (INK - PAPER) * np.minimum(ink, 1.0)).astype(np.float32)


def _shares(start: float, stop: float) -> Array:
    """How much of each texel from ``int(start)`` on lies between two positions."""
    texels = np.arange(int(start), int(np.ceil(stop - 1e-9)))
    return np.minimum(texels + 1, stop) - np.maximum(texels, start)


@lru_cache(maxsize=2)
def _wall(height_px: int, width_px: int) -> Array:
    """A quiet background with soft shades."""
    coarse = np.random.default_rng(3).uniform(70, 135, (6, 8)).astype(np.float32)
    return cv2.resize(coarse, (width_px, height_px), interpolation=cv2.INTER_CUBIC)
