"""How a scene looks to every camera: the texture of its ground, and its light."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tr_grasp.sensing.camera import PinholeCamera

Array = NDArray[np.floating]
SAMPLES = 3
"""A pixel's colour is the mean of so many times so many rays, as a texture finer than pixels would flicker."""


@dataclass(frozen=True, eq=False)
class GroundTexture:
    """A square picture, repeated without end over the plane z = 0 of the base frame.

    Attributes:
        image: (n, n, 3) float32 colours in [0, 1], which continue over every edge at the opposite one.
        side_m: Edge of the square on the ground.
        yaw_rad: Turn of the square about the vertical through the origin.
    """

    image: NDArray[np.float32]
    side_m: float = 1.0
    yaw_rad: float = 0.0

    @classmethod
    def uniform(cls, colour: tuple[float, float, float]) -> GroundTexture:
        """Ground of one colour."""
        return cls(np.asarray(colour, np.float32).reshape(1, 1, 3))

    def uv(self, xy_m: Array) -> Array:
        """(n, 2) places in the picture, 1 to an edge, of points (n, 2) of the ground; columns first, then rows."""
        c, s = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        return xy_m @ (np.array([[c, -s], [s, c]]) / self.side_m).astype(xy_m.dtype)

    def colour_at(self, xy_m: Array) -> NDArray[np.float32]:
        """(n, 3) colours of points (n, 2) of the ground, blended between the four nearest pixels."""
        size = len(self.image)
        if size == 1:
            return np.broadcast_to(self.image[0], (len(xy_m), 3))
        places = self.uv(xy_m) * size - 0.5
        first = np.floor(places)
        share = (places - first).astype(np.float32)
        column, row = (first.astype(np.int64) % size).T
        right, below = (column + 1) % size, (row + 1) % size
        flat, (x, y) = self.image.reshape(-1, 3), share.T[..., None]
        above = flat[row * size + column] * (1 - x) + flat[row * size + right] * x
        under = flat[below * size + column] * (1 - x) + flat[below * size + right] * x
        return above * (1 - y) + under * y


@dataclass(frozen=True, eq=False)
class Light:
    """A sun without shadows, and light from everywhere.

    Attributes:
        to_sun: (3,) unit vector of the base frame.
        sun: Brightness that the sun adds to a surface that faces it.
        ambient: Brightness of a surface that it does not reach.
    """

    to_sun: Array
    sun: float
    ambient: float

    def brightness(self, normals: Array) -> NDArray[np.float32]:
        """(n, 1) factor on the colours of surfaces with these normals (n, 3) towards the camera."""
        facing = np.clip(normals @ self.to_sun, 0, None)
        return (self.ambient + self.sun * facing).astype(np.float32)[:, None]

    def shaded(self, colours: Array, normals: Array) -> NDArray[np.float32]:
        """(n, 3) colours in [0, 1] under this light; surfaces without a normal (zeros) keep theirs."""
        has_normal = (normals != 0).any(axis=1, keepdims=True)
        return np.clip(np.where(has_normal, colours * self.brightness(normals), colours), 0, 1).astype(np.float32)


@dataclass(frozen=True)
class Look:
    """What cameras make of what they see: its own colours, unless there is a light.

    Attributes:
        ground: Texture of the ground; its plain colour if there is none.
        light: What shades everything; if there is none, colours are those of the surfaces (albedo).
    """

    ground: GroundTexture | None = None
    light: Light | None = None


def ground_colours(ground: GroundTexture, camera: PinholeCamera, pixels: NDArray[np.integer]) -> NDArray[np.float32]:
    """(n, 3) mean colour of the ground in each of some pixels, given as flat indices (n,), which all show it."""
    row, column = np.divmod(pixels, camera.width_px)
    if len(ground.image) == 1:
        return ground.colour_at(np.zeros((len(pixels), 2)))
    total = np.zeros((len(pixels), 3), np.float32)
    R, eye = camera.T_base_cam[:3, :3].astype(np.float32), camera.T_base_cam[:3, 3].astype(np.float32)
    row, column = row.astype(np.float32), column.astype(np.float32)
    for part in np.ndindex(SAMPLES, SAMPLES):
        down, right = ((index + 0.5) / SAMPLES for index in part)
        x = (column + right - camera.width_px / 2) / camera.focal_px
        y = (row + down - camera.height_px / 2) / camera.focal_px
        directions = np.stack([x, y, np.ones_like(x)], axis=1) @ R.T
        # Where a pixel reaches over the horizon, its sample is taken from far away, not from behind.
        distance = eye[2] / np.maximum(-directions[:, 2], 1e-3)
        total += ground.colour_at(eye[:2] + directions[:, :2] * distance[:, None])
    return (total / SAMPLES**2).astype(np.float32, copy=False)
