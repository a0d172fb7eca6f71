import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tr_grasp.geometry import (
    invert_transform,
    look_at,
    matrix_from_wxyz,
    random_wxyz,
    rotation_about_z,
    transform_from,
    transform_points,
    wrap_half_turn,
    wxyz_from_matrix,
)

coordinates = st.floats(-5, 5)
vectors = st.tuples(coordinates, coordinates, coordinates).map(np.array)
seeds = st.integers(0, 2**31)


def transform(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return transform_from(matrix_from_wxyz(random_wxyz(rng)), rng.uniform(-2, 2, 3))


@given(seed=seeds, point=vectors)
def test_the_inverse_takes_a_point_back(seed, point):
    T = transform(seed)
    np.testing.assert_allclose(transform_points(invert_transform(T), transform_points(T, point)), point, atol=1e-9)


def test_many_transforms_are_inverted_one_by_one():
    T = np.stack([transform(seed) for seed in range(6)]).reshape(2, 3, 4, 4)
    np.testing.assert_array_equal(invert_transform(T)[1, 2], invert_transform(T[1, 2]))


def test_a_quarter_turn_about_z_takes_x_to_y():
    np.testing.assert_allclose(rotation_about_z(np.pi / 2) @ [1, 0, 0], [0, 1, 0], atol=1e-12)


@given(seed=seeds)
def test_quaternions_agree_with_scipy(seed):
    q = random_wxyz(np.random.default_rng(seed))
    np.testing.assert_allclose(matrix_from_wxyz(q), Rotation.from_quat(q[[1, 2, 3, 0]]).as_matrix(), atol=1e-12)


@given(seed=seeds)
def test_a_rotation_is_the_same_after_a_visit_to_quaternions(seed):
    R = np.stack([transform(seed)[:3, :3], transform(seed + 1)[:3, :3]])
    q = wxyz_from_matrix(R)
    np.testing.assert_allclose(matrix_from_wxyz(q), R, atol=1e-12)
    assert (q[:, 0] >= 0).all()


def test_a_batch_of_quaternions_is_converted_one_by_one():
    rng = np.random.default_rng(0)
    q = np.stack([random_wxyz(rng) for _ in range(5)])
    np.testing.assert_array_equal(matrix_from_wxyz(q)[3], matrix_from_wxyz(q[3]))


@given(eye=vectors, target=vectors)
def test_a_camera_sees_its_target_on_the_optical_axis(eye, target):
    if np.linalg.norm(np.cross(target - eye, [0, 0, 1])) < 1e-3:
        return
    T = look_at(eye, target)
    seen = transform_points(invert_transform(T), target)
    np.testing.assert_allclose(seen, [0, 0, np.linalg.norm(target - eye)], atol=1e-6)
    np.testing.assert_allclose(T[:3, :3].T @ T[:3, :3], np.eye(3), atol=1e-9)
    assert np.linalg.det(T[:3, :3]) > 0
    assert T[2, 1] <= 1e-9  # the picture's y axis points down


def test_a_camera_on_the_x_axis_that_looks_at_the_origin_has_y_on_its_right():
    np.testing.assert_allclose(look_at([1, 0, 0], [0, 0, 0])[:3, 0], [0, 1, 0], atol=1e-12)


def test_a_camera_cannot_look_straight_down_with_z_upwards():
    with pytest.raises(ValueError, match="move one of them"):
        look_at([0, 0, 1], [0, 0, 0])


@given(angle=st.floats(-20, 20))
def test_wrapping_changes_an_angle_by_half_turns_only(angle):
    wrapped = wrap_half_turn(angle)
    assert -np.pi / 2 <= wrapped < np.pi / 2 + 1e-9
    assert abs(np.sin(wrapped - angle)) < 1e-6
