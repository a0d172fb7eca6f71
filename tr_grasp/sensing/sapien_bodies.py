"""What a ray caster sees, for SAPIEN's renderer: bodies coloured by face, and the textured ground."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from sapien import render

from tr_grasp.sensing.look import GroundTexture
from tr_grasp.sensing.raycast import Body

MIPMAP_LEVELS = 6


def render_body(body: Body) -> render.RenderBodyComponent:
    """A body whose faces keep their own vertices and look up their colour in a texture of one pixel a face."""
    corners = np.asarray(body.vertices, np.float32)[body.faces].reshape(-1, 3)
    faces = np.arange(len(corners), dtype=np.uint32).reshape(-1, 3)
    sides = corners.reshape(-1, 3, 3)
    normals = np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    image, uvs = _one_pixel_a_face(body.face_colours)
    material = _material(image, "nearest", mipmap_levels=1)
    component = render.RenderBodyComponent()
    component.attach(render.RenderShapeTriangleMesh(corners, faces, np.repeat(normals, 3, axis=0), uvs, material))
    return component


def render_ground(ground: GroundTexture, half_side_m: float) -> render.RenderBodyComponent:
    """A square of the plane z = 0 around the origin with the texture repeated over it."""
    corners = half_side_m * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32)
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    normals = np.tile(np.array([0, 0, 1], np.float32), (4, 1))
    uvs = ground.uv(corners[:, :2]).astype(np.float32)
    levels = min(MIPMAP_LEVELS, int(np.log2(len(ground.image))) + 1)
    component = render.RenderBodyComponent()
    material = _material(ground.image, "linear", mipmap_levels=levels)
    component.attach(render.RenderShapeTriangleMesh(corners, faces, normals, uvs, material))
    return component


def _material(
    image: NDArray[np.floating], filter_mode: Literal["nearest", "linear"], mipmap_levels: int
) -> render.RenderMaterial:
    pixels = np.full((*image.shape[:2], 4), 255, np.uint8)
    pixels[..., :3] = np.round(255 * np.clip(image, 0, 1))
    material = render.RenderMaterial(roughness=0.9, specular=0.1)
    material.base_color_texture = render.RenderTexture2D(
        pixels, "R8G8B8A8Unorm", mipmap_levels, filter_mode=filter_mode, address_mode="repeat", srgb=True
    )
    return material


def _one_pixel_a_face(face_colours: NDArray[np.floating]) -> tuple[NDArray[np.floating], NDArray[np.float32]]:
    """A square picture of the colours in reading order, and (3 * faces, 2) coordinates of their pixels."""
    side = int(np.ceil(np.sqrt(len(face_colours))))
    pixels = np.ones((side * side, 3))
    pixels[: len(face_colours)] = face_colours
    rows, columns = np.divmod(np.arange(len(face_colours)), side)
    uvs = (np.column_stack([columns, rows]) + 0.5) / side
    return pixels.reshape(side, side, 3), np.repeat(uvs, 3, axis=0).astype(np.float32)
