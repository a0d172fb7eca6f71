"""The object found by a camera."""

from dataclasses import replace

import numpy as np
import pytest

from tests.pick_place.eye import CAMERA, Eye
from tr_grasp.pick_place import find_object, read_station
from tr_grasp.pick_place.find import points_of


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


def test_nothing_something_else_or_nowhere_to_look_is_said(cfg):
    assert "points stand where to look" in find_object(Eye(0.3, 0.5).capture(), CAMERA.T_base_cam, cfg)
    assert "no cylinder of radius" in find_object(Eye(-0.3, -0.6, radius=0.09).capture(), CAMERA.T_base_cam, cfg)
    assert "search_m" in find_object(Eye(-0.3, -0.6).capture(), CAMERA.T_base_cam, replace(cfg, search_m=None))
