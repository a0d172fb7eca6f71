from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.sensing.test_raycast import BALL, body
from tr_grasp.geometry import transform_from
from tr_grasp.sensing import Body, PinholeCamera, RaycastCamera, RaycastScene
from tr_grasp.sensing.look import GroundTexture, Light, Look, ground_colours
from tr_grasp.sensing.srgb import from_linear, to_linear

CAMERA = PinholeCamera.looking_at((0.8, -0.3, 0.7), (0.3, 0.0, 0.0), 0.6, 24)
CORNERS = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float)
PLAIN = Body.uniform(CORNERS, [[0, 1, 2], [0, 2, 3]], (0.5, 0.4, 0.3))
FOUR = np.array([[[1, 0, 0], [0, 1, 0]], [[0, 0, 1], [1, 1, 1]]], np.float32)


def test_pixels_lie_where_rows_and_columns_say():
    ground = GroundTexture(FOUR, side_m=2.0)
    centres = np.array([[0.5, 0.5], [1.5, 0.5], [0.5, 1.5], [1.5, 1.5]])
    np.testing.assert_allclose(ground.colour_at(centres), FOUR.reshape(-1, 3), atol=1e-6)
    np.testing.assert_allclose(ground.colour_at(np.array([[1.0, 0.5]])), [[0.5, 0.5, 0]], atol=1e-6)


def test_a_quarter_turn_brings_the_colour_of_x_to_y():
    flat, turned = GroundTexture(FOUR, 2.0), GroundTexture(FOUR, 2.0, np.pi / 2)
    np.testing.assert_allclose(
        turned.colour_at(np.array([[-0.5, 1.5]])), flat.colour_at(np.array([[1.5, 0.5]])), atol=1e-5
    )


@given(x=st.integers(-3, 3), y=st.integers(-3, 3), seed=st.integers(0, 1000))
def test_a_texture_repeats(x, y, seed):
    rng = np.random.default_rng(seed)
    ground, points = GroundTexture(FOUR, 0.4), rng.uniform(-1, 1, (5, 2))
    np.testing.assert_allclose(ground.colour_at(points), ground.colour_at(points + 0.4 * np.array([x, y])), atol=1e-4)


def test_a_pixel_is_the_mean_of_the_ground_that_it_covers():
    rng = np.random.default_rng(0)
    ground = GroundTexture(rng.random((64, 64, 3), dtype=np.float32), 0.5, 0.7)
    fine = PinholeCamera(CAMERA.T_base_cam, CAMERA.fov_rad, 24 * 15, 24 * 15)
    rays = fine.rays_base.astype(float)
    points = rays[:, :2] - rays[:, 3:5] * (rays[:, 2] / rays[:, 5])[:, None]
    slow = ground.colour_at(points).reshape(24, 15, 24, 15, 3).mean(axis=(1, 3)).reshape(-1, 3)
    quick = ground_colours(ground, CAMERA, np.arange(24 * 24))
    assert np.abs(quick - slow).mean() < 0.05
    assert np.abs(quick.mean(axis=0) - slow.mean(axis=0)).max() < 0.005


def test_the_camera_shows_the_texture_on_the_ground_and_nowhere_else():
    scene, aside = RaycastScene([body(BALL, (1, 0, 0))], still=[PLAIN]), transform_from(np.eye(3), [0.3, 0, 0.05])[None]
    plain = RaycastCamera(scene, CAMERA).capture(aside)
    look = Look(GroundTexture.uniform((0.1, 0.9, 0.2)))
    dressed = RaycastCamera(scene, CAMERA, look=look).capture(aside)
    np.testing.assert_array_equal(plain.depth, dressed.depth)
    ball = (plain.colour == [1, 0, 0]).all(axis=-1)
    assert 10 < ball.sum() < 400
    np.testing.assert_array_equal(dressed.colour[ball], plain.colour[ball])
    np.testing.assert_allclose(dressed.colour[~ball], np.tile([0.1, 0.9, 0.2], ((~ball).sum(), 1)), atol=1e-6)


def test_a_light_brightens_what_faces_it():
    light = Light(np.array([0.0, 0.0, 1.0]), sun=0.5, ambient=0.25)
    normals = np.array([[0, 0, 1], [1, 0, 0], [0, 0, -1], [0, 0.6, 0.8], [0, 0, 0]], float)
    shaded = light.shaded(np.full((5, 3), 0.8), normals)
    np.testing.assert_allclose(shaded[:, 0], [0.6, 0.2, 0.2, 0.52, 0.8], atol=1e-6)


def test_the_camera_shades_ground_and_bodies_alike():
    scene, pose = RaycastScene([body(BALL, (1, 1, 1))], still=[PLAIN]), transform_from(np.eye(3), [0.3, 0, 0.05])[None]
    light = Light(np.array([0.0, 0.0, 1.0]), sun=0.5, ambient=0.25)
    plain = RaycastCamera(scene, CAMERA).capture(pose).colour
    lit = RaycastCamera(scene, CAMERA, look=Look(light=light)).capture(pose).colour
    ball = (plain == 1).all(axis=-1)
    np.testing.assert_allclose(lit[~ball], 0.75 * plain[~ball], atol=1e-6)
    assert lit[ball].min() < 0.6
    assert 0.7 < lit[ball].max() <= 0.75


@settings(max_examples=20)
@given(value=st.floats(0, 1))
def test_srgb_and_linear_undo_each_other(value):
    np.testing.assert_allclose(from_linear(to_linear(value)), value, atol=2e-6)


def test_middle_grey_is_a_fifth_of_the_light():
    np.testing.assert_allclose(to_linear(0.5), 0.2140, atol=1e-4)
    np.testing.assert_allclose(to_linear([0.0, 0.04, 1.0]), [0, 0.04 / 12.92, 1], atol=1e-6)
