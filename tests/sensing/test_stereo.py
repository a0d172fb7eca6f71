"""The errors of a stereo depth camera."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tr_grasp.configs import StereoCfg
from tr_grasp.sensing import DepthImage, PinholeCamera
from tr_grasp.sensing.stereo import D415, depth_error_m, focal_px, in_shadow, incidence_rad, with_stereo_errors

EXACT = replace(D415, disparity_noise_px=0.0, disparity_step_px=1e-5)


def camera_of(size_px: int = 80, fov_rad: float = 0.47, eye: tuple[float, ...] = (1.0, 0.0, 0.6)) -> PinholeCamera:
    return PinholeCamera.looking_at(eye, (0.5, 0.0, 0.0), fov_rad, size_px)


def wall(depth_m: float, size_px: int = 80) -> DepthImage:
    """A plane that faces the camera."""
    return DepthImage(np.full((size_px, size_px), depth_m, np.float32), np.zeros((size_px, size_px, 3), np.float32))


def table(camera: PinholeCamera) -> DepthImage:
    """The plane z = 0 of the base frame."""
    rays = camera.rays_base
    depth = (-rays[:, 2] / rays[:, 5]).reshape(camera.height_px, camera.width_px)
    return DepthImage(depth, np.zeros((*depth.shape, 3), np.float32))


def errors_of(depth_m: float, size_px: int = 200, fov_rad: float = 0.47) -> np.ndarray:
    seen = with_stereo_errors(wall(depth_m, size_px), camera_of(size_px, fov_rad), np.random.default_rng(0))
    return (seen.depth - np.float32(depth_m)).ravel()


@pytest.mark.parametrize("depth_m", [0.5, 1.0, 2.0])
def test_the_error_on_a_wall_is_what_intel_states(depth_m: float) -> None:
    errors = errors_of(depth_m)
    assert np.sqrt((errors**2).mean()) == pytest.approx(depth_error_m(depth_m), rel=0.05)
    assert abs(errors.mean()) < 0.05 * depth_error_m(depth_m) + 0.5 * depth_m**2 * D415.disparity_step_px / 55.0
    assert np.quantile(np.abs(errors), 0.95) < 0.02 * depth_m  # datasheet: at most 2 % up to 2 m


def test_by_hand_the_error_at_a_metre_is_1_46_mm() -> None:
    assert focal_px(D415) == pytest.approx(640 / np.tan(np.radians(32.5)))
    rounding_px = (1 / 32) / np.sqrt(12)
    assert depth_error_m(1.0) == pytest.approx(np.hypot(0.08, rounding_px) / (1004.6 * 0.055), rel=1e-3)
    assert depth_error_m(1.0) == pytest.approx(1.46e-3, abs=1e-5)


@pytest.mark.parametrize("size_px", [60, 240, 600])
def test_the_errors_do_not_depend_on_the_resolution(size_px: int) -> None:
    assert errors_of(1.0, size_px).std() == pytest.approx(depth_error_m(1.0), rel=0.1)


def test_neighbouring_pixels_err_together_where_they_are_as_fine_as_the_device() -> None:
    def correlation(fov_rad: float) -> float:
        errors = errors_of(1.0, 200, fov_rad).reshape(200, 200)
        return float(np.corrcoef(errors[:, 1:].ravel(), errors[:, :-1].ravel())[0, 1])

    assert correlation(0.198) > 0.8  # 200 of these pixels span what 200 of the device's do
    assert abs(correlation(0.9)) < 0.05


@given(depth_m=st.floats(0.46, 9.9))
@settings(max_examples=30, deadline=None)
def test_without_noise_depth_in_range_comes_back(depth_m: float) -> None:
    seen = with_stereo_errors(wall(depth_m, 16), camera_of(16), np.random.default_rng(0), EXACT)
    np.testing.assert_allclose(seen.depth, depth_m, rtol=1e-4)


@given(seed=st.integers(0, 1000), step=st.sampled_from([1 / 32, 1 / 8, 1.0]))
@settings(max_examples=30, deadline=None)
def test_every_disparity_is_a_multiple_of_the_step(seed: int, step: float) -> None:
    device = replace(D415, disparity_step_px=step)
    seen = with_stereo_errors(wall(1.3, 16), camera_of(16), np.random.default_rng(seed), device)
    steps = focal_px(device) * device.baseline_m / seen.depth / step
    np.testing.assert_allclose(steps, np.round(steps), atol=2e-3)


@pytest.mark.parametrize("depth_m", [0.3, 0.44, 11.0, np.inf])
def test_out_of_range_and_in_the_void_there_is_no_depth(depth_m: float) -> None:
    seen = with_stereo_errors(wall(depth_m, 16), camera_of(16), np.random.default_rng(0), EXACT)
    assert np.isinf(seen.depth).all()


@pytest.mark.parametrize("elevation_deg", [80.0, 45.0, 20.0])
def test_the_incidence_on_a_table_is_that_of_its_normal(elevation_deg: float) -> None:
    elevation = np.radians(elevation_deg)
    camera = camera_of(eye=(0.5 + np.cos(elevation), 0.0, np.sin(elevation)))
    rays = camera.rays_base[:, 3:]
    expected = np.arccos(-rays[:, 2] / np.linalg.norm(rays, axis=1)).reshape(80, 80)
    inverse = 1.0 / table(camera).depth
    np.testing.assert_allclose(incidence_rad(inverse, camera), expected, atol=2e-3)


def test_a_silhouette_is_no_slope() -> None:
    depth = wall(1.0).depth
    depth[:, 30:50] = 0.6
    assert incidence_rad(1.0 / depth, camera_of()).max() < 0.5


def test_depth_fails_where_rays_graze_the_table_and_holds_where_they_do_not() -> None:
    def holes(elevation_deg: float) -> float:
        elevation = np.radians(elevation_deg)
        camera = camera_of(fov_rad=0.1, eye=(0.5 + np.cos(elevation), 0.0, np.sin(elevation)))
        seen = with_stereo_errors(table(camera), camera, np.random.default_rng(0), EXACT)
        return float(np.isinf(seen.depth).mean())

    assert holes(40.0) == 0.0
    assert 0.3 < holes(17.5) < 0.7  # in the middle of the ramp
    assert holes(6.0) == 1.0


def test_by_hand_a_box_casts_a_shadow_to_its_left_as_wide_as_the_disparities_differ() -> None:
    camera, depth = camera_of(160), wall(1.0, 160).depth
    depth[40:120, 80:120] = 0.5
    shadow = in_shadow(1.0 / depth, camera)
    width = camera.focal_px * 0.055 * (1 / 0.5 - 1 / 1.0)  # 18.4 px
    assert not shadow[:40].any()
    np.testing.assert_array_equal(np.flatnonzero(shadow[60]), np.arange(80 - int(width), 80))


def slow_shadow(depth: np.ndarray, focal: float, baseline: float) -> np.ndarray:
    """For each pixel, look at every other one to the right in its row."""
    hidden = np.zeros(depth.shape, bool)
    for row, column in np.ndindex(depth.shape):
        here = column - focal * baseline / depth[row, column]
        for right in range(column + 1, depth.shape[1]):
            hidden[row, column] |= right - focal * baseline / depth[row, right] < here
    return hidden


@given(seed=st.integers(0, 1000))
@settings(max_examples=20, deadline=None)
def test_shadows_are_those_of_the_definition(seed: int) -> None:
    rng = np.random.default_rng(seed)
    depth = np.where(rng.random((4, 20)) < 0.3, rng.uniform(0.4, 0.8, (4, 20)), 1.0).astype(np.float32)
    camera = PinholeCamera(np.eye(4), 0.1, 20, 4)
    np.testing.assert_array_equal(in_shadow(1.0 / depth, camera), slow_shadow(depth, camera.focal_px, 0.055))


def test_equal_generators_give_equal_pictures_and_the_original_stays() -> None:
    camera = camera_of()
    image = table(camera)
    before = image.depth.copy()
    first, second = (with_stereo_errors(image, camera, np.random.default_rng(3)) for _ in range(2))
    np.testing.assert_array_equal(first.depth, second.depth)
    np.testing.assert_array_equal(image.depth, before)
    assert first.colour is image.colour
    assert first.depth.dtype == np.float32


def test_a_device_with_twice_the_baseline_errs_half_as_much() -> None:
    wide = StereoCfg(baseline_m=0.11)
    assert depth_error_m(1.0, wide) == pytest.approx(depth_error_m(1.0) / 2)
