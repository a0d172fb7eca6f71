from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from tr_grasp.geometry import matrix_from_wxyz, random_wxyz, transform_from
from tr_grasp.grasps import Grasps, farthest_points, pose_distance
from tr_grasp.grasps.poses import TURN_M_PER_RAD


def random_poses(seed: int, n: int = 8):
    rng = np.random.default_rng(seed)
    return np.stack([transform_from(matrix_from_wxyz(random_wxyz(rng)), rng.uniform(-0.1, 0.1, 3)) for _ in range(n)])


@given(st.integers(0, 1000))
def test_distance_is_symmetric_and_zero_to_itself(seed):
    poses = random_poses(seed, 2)
    there, back = pose_distance(poses[0], poses)[1], pose_distance(poses[1], poses)[0]
    np.testing.assert_allclose(there, back, atol=1e-9)
    np.testing.assert_allclose(pose_distance(poses[0], poses)[0], 0.0, atol=1e-8)


def test_a_hand_turned_by_half_a_turn_is_the_same_grasp():
    T = random_poses(3, 1)
    swapped = T @ np.diag([-1.0, -1.0, 1.0, 1.0])
    np.testing.assert_allclose(pose_distance(T[0], swapped), 0.0, atol=1e-8)


def test_three_centimetres_and_a_turn_that_counts_for_four_are_five_apart():
    angle = 0.04 / TURN_M_PER_RAD
    other = np.eye(4)
    other[:3, :3] = [[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]]
    other[0, 3] = 0.03
    np.testing.assert_allclose(pose_distance(np.eye(4), other[None]), 0.05)


def test_farthest_points_take_the_ends_before_the_middle():
    poses = np.tile(np.eye(4), (5, 1, 1))
    poses[:, 0, 3] = [0.0, 0.01, 0.02, 0.03, 0.04]
    worth = np.array([1.0, 0.5, 0.5, 0.5, 0.5])
    assert farthest_points(poses, worth, 3).tolist() == [0, 4, 2]


def test_a_choice_never_repeats_and_never_exceeds_what_there_is():
    poses = np.tile(np.eye(4), (4, 1, 1))  # all in one place
    assert sorted(farthest_points(poses, np.ones(4), 9)) == [0, 1, 2, 3]
    assert farthest_points(poses, np.ones(4), 0).size == 0
    assert farthest_points(poses[:0], np.ones(0), 3).size == 0


def test_poses_of_grasps_point_along_their_approach():
    grasps = Grasps(np.zeros((1, 3)), np.array([[0.0, 1.0, 0.0, 0.0]]), np.array([0.04]))
    np.testing.assert_allclose(grasps.approach(), [[0.0, 0.0, -1.0]], atol=1e-12)
