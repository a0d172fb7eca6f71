"""A picture of an octree: its leaves as shaded cubes, and the gripper as a glyph."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from tr_grasp.octree import OctreeFrame, OctreeSpec
from tr_grasp.octree.morton import cell_table

Array = NDArray[np.floating]

BACKGROUND = (238, 241, 245)
WIRE = (176, 184, 196)
NO_COLOUR = (0.55, 0.62, 0.72)
"""Leaves of an octree without colour."""
FACE_BRIGHTNESS = (0.62, 0.8, 1.0)
"""Of the faces across x, y and z."""
FINGER_LENGTH_M = 0.045
OPEN_FINGER_M = 0.04
"""How far an open finger is from the tcp."""
_SMOOTHING = 2


@dataclass(frozen=True, eq=False)
class Gripper:
    """What the proprioception says of the gripper, in the base frame."""

    tcp_m: Array
    """``(3,)`` position."""
    closing_axis: Array
    """``(3,)`` unit vector along which the fingers move."""
    opening: float
    """1 is open, -1 closed."""


class OctreeView:
    """An orthographic view of one cube.

    Parallel rays see equal cubes of a lattice, so drawing them from far to near is exactly right.

    Args:
        spec: The cube.
        direction: Where the viewer looks (base frame); not straight down.
        size_px: Width and height of the pictures.
    """

    def __init__(self, spec: OctreeSpec, direction: Array, size_px: int = 320) -> None:
        self._spec, self.size_px = spec, size_px
        self._forward = np.asarray(direction, float) / np.linalg.norm(direction)
        right = np.cross(self._forward, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right)
        corners = (np.indices((2, 2, 2)).reshape(3, -1).T - 0.5) * spec.side_m
        # Image axes: x to the right, y down.
        axes = np.stack([right, np.cross(self._forward, right)])
        self._scale = 0.92 * size_px / np.ptp(corners @ axes.T, axis=0).max()
        self._axes = axes * self._scale * _SMOOTHING
        self._faces = _visible_faces(self._forward)

    def project(self, points_m: Array) -> Array:
        """``(*batch, 3)`` points of the base frame to ``(*batch, 2)`` pixels (x right, y down)."""
        return self._project(points_m) / _SMOOTHING

    def draw(self, frame: OctreeFrame, gripper: Gripper | None = None) -> NDArray[np.uint8]:
        """A ``(size, size, 3)`` picture of one octree (batch ``[]``)."""
        size = self.size_px * _SMOOTHING
        image = Image.new("RGB", (size, size), BACKGROUND)
        pencil = ImageDraw.Draw(image)
        self._draw_far_edges(pencil)
        self._draw_leaves(pencil, frame)
        if gripper is not None:
            self._draw_gripper(pencil, gripper)
        return np.asarray(image.reduce(_SMOOTHING))

    def _project(self, points_m: Array) -> Array:
        offset = np.asarray(points_m) - np.array(self._spec.centre_m)
        return offset @ self._axes.T + self.size_px * _SMOOTHING / 2

    def _draw_far_edges(self, pencil: ImageDraw.ImageDraw) -> None:
        origin, side = np.array(self._spec.origin_m), self._spec.side_m
        hidden = (self._forward > 0).astype(float)
        for axis in range(3):
            for other in range(3):
                if other == axis:
                    continue
                start, end = hidden.copy(), hidden.copy()
                start[other], end[other] = 0, 1
                for height in (0, 1):
                    start[axis] = end[axis] = height
                    ends = self._project(origin + np.stack([start, end]) * side)
                    pencil.line([tuple(p) for p in ends], fill=WIRE, width=_SMOOTHING)

    def _draw_leaves(self, pencil: ImageDraw.ImageDraw, frame: OctreeFrame) -> None:
        cells, colours = _leaves(frame, self._spec)
        order = np.argsort(-(cells @ self._forward), kind="stable")
        cells, colours = cells[order], colours[order]
        occupied = np.zeros((self._spec.cells_n + 2,) * 3, bool)
        occupied[tuple((cells + 1).T)] = True
        corners = np.array(self._spec.origin_m) + cells * self._spec.leaf_m
        polygons, shades, shown = [], [], []
        for (corner_offsets, towards), brightness in zip(self._faces, FACE_BRIGHTNESS, strict=True):
            polygons.append(self._project(corners[:, None] + corner_offsets * self._spec.leaf_m))
            shades.append((255 * colours * brightness).astype(np.uint8))
            shown.append(~occupied[tuple((cells + 1 + towards).T)])
        for leaf in range(len(cells)):
            for face in range(3):
                if shown[face][leaf]:
                    shade = shades[face][leaf]
                    edge = tuple((shade * 0.82).astype(int).tolist())
                    pencil.polygon(polygons[face][leaf].ravel().tolist(), fill=tuple(shade.tolist()), outline=edge)

    def _draw_gripper(self, pencil: ImageDraw.ImageDraw, gripper: Gripper) -> None:
        reach = OPEN_FINGER_M * (gripper.opening + 1) / 2
        up = np.array([0, 0, FINGER_LENGTH_M])
        tips = np.stack([gripper.tcp_m + s * (reach + 0.004) * gripper.closing_axis for s in (-1, 1)])
        wide = np.stack([gripper.tcp_m + s * (OPEN_FINGER_M + 0.01) * gripper.closing_axis for s in (-1, 1)])
        for width, colour in ((5, (255, 255, 255)), (3, (28, 36, 52))):
            strokes = [(tip, tip + up) for tip in tips] + [(wide[0] + up, wide[1] + up)]
            strokes.append((gripper.tcp_m + up, gripper.tcp_m + 2 * up))
            for stroke in strokes:
                pencil.line([tuple(p) for p in self._project(np.stack(stroke))], fill=colour, width=width * _SMOOTHING)


def _leaves(frame: OctreeFrame, spec: OctreeSpec) -> tuple[NDArray[np.int64], Array]:
    """``(n, 3)`` cells and ``(n, 3)`` colours in [0, 1] of the leaves that are there."""
    there = frame.codes >= 0
    cells = cell_table(spec.depth, torch.device("cpu"))[frame.codes[there].long()].numpy()
    if not spec.colour:
        return cells, np.broadcast_to(NO_COLOUR, cells.shape)
    return cells, np.clip(frame.features[there][:, -3:].float().numpy(), 0, 1)


def _visible_faces(forward: Array) -> list[tuple[Array, NDArray[np.int64]]]:
    """For each axis the face that the viewer sees: its ``(4, 3)`` corners in a unit cube, and where it faces."""
    faces = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        near = forward[axis] < 0
        corners = np.zeros((4, 3))
        corners[:, axis] = float(near)
        corners[:, u], corners[:, v] = [0, 1, 1, 0], [0, 0, 1, 1]
        towards = np.zeros(3, np.int64)
        towards[axis] = 1 if near else -1
        faces.append((corners, towards))
    return faces
