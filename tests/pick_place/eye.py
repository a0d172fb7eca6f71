"""A camera that sees a bottle on the floor, and nothing else."""

from __future__ import annotations

import numpy as np

from tr_grasp.geometry import transform_from
from tr_grasp.hardware import RGBDImage, intrinsics_of
from tr_grasp.objects.bottle import bottle
from tr_grasp.sensing import Body, PinholeCamera, RaycastCamera, RaycastScene

CAMERA = PinholeCamera.looking_at((0.5, -0.5, 0.5), (-0.3, -0.58, 0.1), 0.5, 160)


class Eye:
    """The bottle has its foot at (x, y), and leans by an angle about the x axis through it."""

    frame = "camera"

    def __init__(self, x, y, radius=0.03, camera=CAMERA, lean_rad=0.0):
        model = bottle(radius, 0.24)
        body = Body(model.visual.vertices, model.visual.faces, model.face_colours)
        floor = Body.uniform([[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]], [[0, 1, 2], [0, 2, 3]], (0.5,) * 3)
        c, s = np.cos(lean_rad), np.sin(lean_rad)
        foot, up = -model.bounds_m[0, 2], np.array([0.0, -s, c])
        self.pose = transform_from([[1, 0, 0], [0, c, -s], [0, s, c]], np.array([x, y, 0.0]) + foot * up)
        self._pose = self.pose[None]
        self._camera = camera
        self._eye = RaycastCamera(RaycastScene([body], [floor]), camera)

    def capture(self):
        shown = self._eye.capture(self._pose)
        depth = np.where(np.isfinite(shown.depth), shown.depth, np.nan).astype(np.float32)
        return RGBDImage(0.0, self.frame, (255 * shown.colour).astype(np.uint8), depth, intrinsics_of(self._camera))
