import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from tr_grasp.geometry import invert_transform, transform_points
from tr_grasp.sensing import DepthImage, PinholeCamera, point_cloud_from_image
from tr_grasp.sensing.noise import with_gaussian_depth_noise
from tr_grasp.sensing.point_cloud import normals_at

CAMERA = PinholeCamera.looking_at((1.0, -0.3, 0.7), (0.5, 0.0, 0.0), 0.5, 32)


def plane_depth(camera: PinholeCamera, height_m: float) -> np.ndarray:
    """Depth of the plane z = height, from the equation of each ray."""
    rays = camera.rays_base.astype(float)
    return ((height_m - rays[:, 2]) / rays[:, 5]).reshape(camera.height_px, camera.width_px)


@given(depth=st.floats(0.1, 5), row=st.integers(0, 31), column=st.integers(0, 31))
def test_a_deprojected_pixel_lies_at_its_depth_on_its_ray(depth, row, column):
    point = CAMERA.deproject(np.full((32, 32), depth))[row, column]
    seen = transform_points(invert_transform(CAMERA.T_base_cam), point)
    np.testing.assert_allclose(seen[2], depth, rtol=1e-5)
    np.testing.assert_allclose(seen[:2] / seen[2] * CAMERA.focal_px + 16, [column + 0.5, row + 0.5], atol=1e-3)


def test_the_middle_of_the_picture_is_the_target():
    camera = PinholeCamera.looking_at((1.0, 0.0, 1.0), (0.0, 0.0, 0.0), 0.4, 3)
    np.testing.assert_allclose(camera.deproject(np.full((3, 3), np.sqrt(2)))[1, 1], 0, atol=1e-6)


def test_a_table_gives_upward_normals_and_its_height():
    depth = plane_depth(CAMERA, 0.0)
    cloud = point_cloud_from_image(
        DepthImage(depth, np.full((32, 32, 3), 0.3)), CAMERA, np.array([0.4, -0.1, -0.01]), np.array([0.6, 0.1, 0.2])
    )
    assert len(cloud.points) > 50
    np.testing.assert_allclose(cloud.points[:, 2], 0, atol=1e-6)
    np.testing.assert_allclose(cloud.normals, np.broadcast_to([0, 0, 1], cloud.normals.shape), atol=1e-4)
    assert (cloud.points >= [0.4, -0.1, -0.01]).all()
    assert (cloud.points < [0.6, 0.1, 0.2]).all()


def test_normals_do_not_bend_at_a_step_in_depth():
    low, high = plane_depth(CAMERA, 0.0), plane_depth(CAMERA, 0.06)
    depth = np.where(np.arange(32)[None, :] < 16, low, high)
    normals = normals_at(np.arange(32 * 32), CAMERA.deproject(depth), depth, CAMERA.T_base_cam[:3, 3])
    normals = normals.reshape(32, 32, 3)
    np.testing.assert_allclose(normals[1:-1, 1:-1], np.broadcast_to([0, 0, 1], (30, 30, 3)), atol=1e-3)


def test_pixels_that_hit_nothing_give_no_point():
    depth = plane_depth(CAMERA, 0.0)
    depth[:16] = np.inf
    cloud = point_cloud_from_image(
        DepthImage(depth, np.zeros((32, 32, 3))), CAMERA, np.full(3, -10.0), np.full(3, 10.0)
    )
    assert len(cloud.points) == 16 * 32
    assert np.isfinite(cloud.normals).all()


def test_noise_has_the_asked_spread_and_repeats_with_its_seed():
    image = DepthImage(np.ones((200, 200), np.float32), np.zeros((200, 200, 3), np.float32))
    noisy = [with_gaussian_depth_noise(image, 0.002, np.random.default_rng(7)).depth for _ in range(2)]
    np.testing.assert_array_equal(noisy[0], noisy[1])
    np.testing.assert_allclose(noisy[0].std(), 0.002, rtol=0.03)
    assert with_gaussian_depth_noise(image, 0.0, np.random.default_rng(7)) is image


@settings(max_examples=20)
@given(seed=st.integers(0, 1000))
def test_a_pixel_meets_a_box_exactly_if_a_point_of_its_ray_is_inside(seed):
    rng = np.random.default_rng(seed)
    lower = rng.uniform([0.2, -0.3, -0.1], [0.5, 0.1, 0.1])
    upper = lower + rng.uniform(0.05, 0.3, 3)
    along = np.linspace(0.2, 1.7, 500)[:, None, None]
    points = CAMERA.rays_base[:, :3] + CAMERA.rays_base[:, 3:] * along
    slow = ((points >= lower) & (points < upper)).all(-1).any(0).reshape(32, 32)
    meets = CAMERA.pixels_that_meet(lower, upper)
    assert not (slow & ~meets).any()
    assert (meets & ~slow).mean() < 0.02  # rays that cut a corner between two samples


def test_a_box_behind_the_camera_meets_no_pixel():
    assert not CAMERA.pixels_that_meet(np.array([1.5, -0.6, 0.7]), np.array([1.7, -0.2, 1.2])).any()
