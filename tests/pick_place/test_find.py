"""The object found by a camera."""

from dataclasses import replace

import numpy as np
import pytest

from tr_grasp.geometry import transform_from
from tr_grasp.hardware import RGBDImage, intrinsics_of
from tr_grasp.objects.bottle import bottle
from tr_grasp.pick_place import find_object, read_station, seen_by
from tr_grasp.pick_place.find import points_of
from tr_grasp.sensing import Body, PinholeCamera, RaycastCamera, RaycastScene

CAMERA = PinholeCamera.looking_at((0.5, -0.5, 0.5), (-0.3, -0.58, 0.1), 0.5, 160)


class Eye:
    """A camera that sees a bottle with its foot at (x, y) on the floor."""

    frame = "camera"

    def __init__(self, x, y, radius=0.03, camera=CAMERA):
        model = bottle(radius, 0.24)
        body = Body(model.visual.vertices, model.visual.faces, model.face_colours)
        floor = Body.uniform([[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]], [[0, 1, 2], [0, 2, 3]], (0.5,) * 3)
        self._pose = transform_from(np.eye(3), (x, y, -model.bounds_m[0, 2]))[None]
        self._camera = camera
        self._eye = RaycastCamera(RaycastScene([body], [floor]), camera)

    def capture(self):
        shown = self._eye.capture(self._pose)
        depth = np.where(np.isfinite(shown.depth), shown.depth, np.nan).astype(np.float32)
        return RGBDImage(0.0, self.frame, (255 * shown.colour).astype(np.uint8), depth, intrinsics_of(self._camera))


@pytest.fixture
def cfg():
    return read_station("thesis")


def test_points_of_a_picture_lie_where_the_camera_says():
    image = Eye(-0.3, -0.58).capture()
    expected = CAMERA.deproject(image.depth_m).reshape(-1, 3)
    expected = expected[np.isfinite(expected).all(axis=1)]
    assert points_of(image, CAMERA.T_base_cam) == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize("place", [(-0.30, -0.58), (-0.27, -0.60), (-0.35, -0.55)])
def test_the_middle_is_found_although_one_side_is_seen(cfg, place):
    found = find_object(Eye(*place).capture(), CAMERA.T_base_cam, cfg)
    assert found == pytest.approx(place, abs=1.5e-3)


def test_the_camera_moves_the_grasp_by_what_it_sees(cfg):
    x, y, _ = cfg.object.foot_m
    moved = seen_by(Eye(x + 0.03, y - 0.02), CAMERA.T_base_cam, cfg)()
    shift = moved.T_base_link("grasp")[:3, 3] - cfg.T_base_link("grasp")[:3, 3]
    assert shift == pytest.approx([0.03, -0.02, 0.0], abs=1.5e-3)


def test_nothing_something_else_or_nowhere_to_look_is_said(cfg):
    assert "points stand where to look" in find_object(Eye(0.3, 0.5).capture(), CAMERA.T_base_cam, cfg)
    assert "no cylinder of radius" in find_object(Eye(-0.3, -0.6, radius=0.09).capture(), CAMERA.T_base_cam, cfg)
    assert "search_m" in find_object(Eye(-0.3, -0.6).capture(), CAMERA.T_base_cam, replace(cfg, search_m=None))
