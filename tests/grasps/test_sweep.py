from __future__ import annotations

import numpy as np
import pytest
import trimesh

from tests.grasps.things import brick, grasps_at
from tr_grasp.errors import GraspError
from tr_grasp.geometry import transform_points
from tr_grasp.grasps import BuildCfg, candidate_grasps, floating_gripper, gripper_names
from tr_grasp.grasps.grippers import hand_poses, pad_centre_z_m
from tr_grasp.grasps.sweep import HandSweep, _shape_corners
from tr_grasp.objects.model import distance_outside


def hand_points(name: str, openness: float):
    """Points all over the hand, in the tcp's frame: a slow twin of the hulls."""
    gripper, points = floating_gripper(name), []
    poses = hand_poses(gripper, openness)
    for link in gripper.links:
        for shape in link.shapes:
            solid = trimesh.convex.convex_hull(transform_points(poses[link.name], _shape_corners(shape)))
            points.append(trimesh.sample.sample_surface(solid, 300, seed=0)[0])
    return np.concatenate(points)


@pytest.mark.parametrize("name", gripper_names())
def test_no_point_of_a_free_hand_enters_the_object_or_the_table_on_its_way(name):
    model = brick()
    grasps, _ = candidate_grasps(model, name, BuildCfg(candidates_n=300))
    points = hand_points(name, 1.0)
    assert 5 < len(grasps) < 290
    for T in grasps.poses()[:40]:
        for back in np.linspace(0.0, BuildCfg().trial.approach_m, 7):
            placed = transform_points(T, points - [0.0, 0.0, back])
            assert distance_outside(model.parts[0], placed).min() > 0
            assert placed[:, 2].min() > model.bounds_m[0, 2]


def test_a_hand_from_the_side_is_free_until_it_is_too_deep_too_low_or_off_centre():
    model, gripper = brick(), floating_gripper("robotiq_2f85")
    sweep = HandSweep(gripper, model, 0.075, 0.003)
    depth = pad_centre_z_m(gripper, gripper.gripper.openness(0.04))
    good = np.array([0.0, 0.03 + depth, 0.02])
    assert sweep.free(grasps_at(good)).tolist() == [True]
    assert sweep.free(grasps_at(good - [0.0, 0.06, 0.0])).tolist() == [False]  # the palm inside
    assert sweep.free(grasps_at(good - [0.0, 0.0, 0.06])).tolist() == [False]  # the hand in the table
    assert sweep.free(grasps_at(good - [-0.025, 0.0, 0.0])).tolist() == [False]  # a finger inside


def test_an_object_wider_than_the_opening_is_refused_with_both_numbers():
    with pytest.raises(GraspError, match=r"nowhere narrower than 90 mm .* opens 85 mm"):
        candidate_grasps(brick((0.09, 0.1, 0.12)), "robotiq_2f85", BuildCfg(candidates_n=100))


@pytest.mark.parametrize("size_m", [(1e-3, 2e-3, 1e-3), (5.0, 1.0, 1.0)])
def test_an_absurd_size_is_refused(size_m):
    with pytest.raises(GraspError, match="meshes are in metres"):
        candidate_grasps(brick(size_m), "robotiq_2f85", BuildCfg())


def test_an_unknown_gripper_names_the_valid_ones():
    with pytest.raises(GraspError, match=r"did you mean 'robotiq_2f85'\? Valid: kg3, panda, rg2, robotiq_2f85"):
        floating_gripper("robotiq_2f84")
