from __future__ import annotations

import numpy as np
import pytest

from tests.grasps.things import brick, two_halves
from tr_grasp.grasps import floating_gripper
from tr_grasp.grasps.antipodal import ContactPairs, antipodal_pairs, hands_on, surface_points
from tr_grasp.grasps.grippers import hand_poses


def test_points_lie_on_the_surface_and_normals_point_out():
    points, normals = surface_points(brick((0.04, 0.06, 0.08)), 500, np.random.default_rng(0))
    at_face = np.isclose(np.abs(points), [0.02, 0.03, 0.04])
    assert at_face.any(axis=1).all()
    assert (np.einsum("ni,ni->n", points, normals) > 0).all()


def test_a_wall_between_two_parts_is_no_surface():
    points, _ = surface_points(two_halves(), 2000, np.random.default_rng(0))
    assert not ((np.abs(points[:, 0]) < 1e-6) & (np.abs(points[:, 1:]) < [0.0449, 0.0599]).all(axis=1)).any()


def test_lines_run_through_touching_parts_as_through_one():
    pairs = antipodal_pairs(two_halves(), 3000, 1e-3, np.random.default_rng(0))
    assert set(np.round(pairs.width_m, 4)) == {0.04, 0.09, 0.12}


def test_both_contacts_are_inside_their_friction_cones():
    friction = 0.4
    pairs = antipodal_pairs(brick(), 2000, friction, np.random.default_rng(1))
    lines = (pairs.second - pairs.first) / pairs.width_m[:, None]
    # On a box the closing line is within the cone of a face if its largest component is.
    assert (np.abs(lines).max(axis=1) >= np.cos(np.arctan(friction)) - 1e-9).all()


def test_a_wedge_that_would_slip_has_no_pairs_across_its_sides():
    import trimesh

    from tr_grasp.objects import ObjectModel, shapes

    steep = shapes.prism([(-0.03, 0.0), (0.03, 0.0), (0.0, 0.03)], -0.02, 0.02)  # 90 degrees at the tip
    assert isinstance(steep, trimesh.Trimesh)
    model = ObjectModel.assemble("wedge", "wedge", [steep], steep, np.full((len(steep.faces), 3), 0.5))
    pairs = antipodal_pairs(model, 4000, 0.3, np.random.default_rng(0))
    assert (np.abs(pairs.second - pairs.first)[:, 2] > 0.039).all()  # only the two flat ends hold


@pytest.mark.parametrize("name", ["robotiq_2f85", "rg2", "panda"])
def test_the_pads_of_a_hand_meet_the_two_contacts(name):
    gripper = floating_gripper(name)
    pairs = ContactPairs(np.array([[-0.02, 0.01, 0.03]]), np.array([[0.02, 0.01, 0.03]]))
    hand = hands_on(pairs, gripper, np.random.default_rng(0))
    T = hand.poses()[0]
    links = hand_poses(gripper, gripper.gripper.openness(0.04))
    pads = []
    for finger in gripper.gripper.fingers:
        T_tcp_pad = links[finger.pad_link]
        pads.append((T @ T_tcp_pad @ [*finger.pad_point_m, 1.0])[:3])
    middle = np.mean(pads, axis=0)
    # Along the approach the depth is random, up to half of the half length of a pad.
    offset = T[:3, :3].T @ (middle - [0.0, 0.01, 0.03])
    finger = gripper.gripper.fingers[0]
    assert abs(offset[2]) <= 0.5 * abs(finger.tip_point_m[2] - finger.pad_point_m[2]) + 1e-4
    np.testing.assert_allclose(offset[:2], 0.0, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(pads[0] - pads[1]), 0.04, atol=1e-3)
