"""Rankings of grasps: who is reachable, who is likely to hold, who is near."""

from __future__ import annotations

import numpy as np
import pytest

from tests.grasps.things import brick
from tr_grasp.errors import GraspError
from tr_grasp.grasps import Grasps, GraspSet, shape_key
from tr_grasp.grasps.motion_aware import MotionAwareScorer
from tr_grasp.grasps.motion_aware.network import QualityNet
from tr_grasp.grasps.ranking import GOOD_MARGIN_M, RankingAids, rank_grasps
from tr_grasp.grasps.reachability import reachability_field
from tr_grasp.motion import CollisionModel, Kinematics, box
from tr_grasp.robots import robot_spec

ARM = Kinematics(robot_spec("ur5_robotiq_2f85"))
BACK_M = 0.075
DOWN = np.array([0.0, 1.0, 0.0, 0.0])


def grasps(*positions, successes=None) -> GraspSet:
    """Hands that point down, at positions in the object's frame."""
    n = len(positions)
    held = np.full(n, 40) if successes is None else np.asarray(successes)
    hands = Grasps(np.array(positions, float), np.tile(DOWN, (n, 1)), np.full(n, 0.04))
    return GraspSet("brick", "robotiq_2f85", hands, held, np.full(n, 50), shape_key(brick(), "robotiq_2f85"))


def object_at(x: float, y: float = 0.0, z: float = 0.1) -> np.ndarray:
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


class Likes(MotionAwareScorer):
    """Says that grasps hold if they are ahead of the motion."""

    def score(self, grasps, velocity_obj_mps):
        ahead = grasps.position_m[:, :2] @ np.asarray(velocity_obj_mps)[:2]
        return np.clip(0.5 + 100 * ahead, 0.0, 1.0)


def likes() -> Likes:
    return Likes("brick", shape_key(brick(), "robotiq_2f85"), QualityNet("ours"), 0.1)


SPREAD = [(0.1 * k, 0.0, 0.0) for k in range(-2, 8)]
"""At x = 0.5 from 0.3 to 1.2 m: the last ones are out of reach."""


@pytest.mark.parametrize("method", ["reachability", "nearness", "both", "ours"])
def test_what_is_out_of_reach_is_not_ranked(method):
    order = rank_grasps(ARM, grasps(*SPREAD), object_at(0.5), ARM.home_q_rad, method, BACK_M)
    assert len(set(order.tolist())) == len(order)
    assert not set(order.tolist()) & {8, 9}
    far = rank_grasps(ARM, grasps(*SPREAD), object_at(5.0), ARM.home_q_rad, method, BACK_M)
    assert len(far) == 0


def test_without_a_ranking_all_come_in_their_order():
    assert rank_grasps(ARM, grasps(*SPREAD), object_at(5.0), ARM.home_q_rad, "none", BACK_M).tolist() == list(range(10))


def test_with_a_field_reachability_is_its_order():
    field = reachability_field("ur5_robotiq_2f85")
    order = rank_grasps(
        ARM, grasps(*SPREAD), object_at(0.5), ARM.home_q_rad, "reachability", BACK_M, RankingAids(field=field)
    )
    T = object_at(0.5) @ grasps(*SPREAD).grasps.poses()
    T[:, 2, 3] += BACK_M
    assert (np.diff(field.values(T)[order]) <= 1e-6).all()
    assert field.values(T)[order[0]] > GOOD_MARGIN_M / 2
    other = Kinematics(robot_spec("ur5_rg2"))
    with pytest.raises(GraspError, match="another model"):
        rank_grasps(other, grasps(*SPREAD), object_at(0.5), other.home_q_rad, "ours", BACK_M, RankingAids(field=field))


def test_motion_ranks_by_the_scorer_in_the_frame_of_the_object():
    T = object_at(0.5)
    T[:3, :3] = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])  # the object's x axis is the base's y axis
    near = grasps((0.05, 0, 0), (-0.05, 0, 0), (0.02, 0, 0))
    aids = RankingAids(scorer=likes(), velocity_base_mps=np.array([0.0, 0.1, 0.0]))
    assert rank_grasps(ARM, near, T, ARM.home_q_rad, "motion", BACK_M, aids).tolist() == [0, 2]
    with pytest.raises(GraspError, match="needs a motion-aware scorer"):
        rank_grasps(ARM, near, T, ARM.home_q_rad, "motion", BACK_M)


def test_both_joins_the_best_five_of_either():
    row = grasps(*[(0.0, 0.02 * k - 0.13, 0.0) for k in range(14)])
    aids = RankingAids(scorer=likes(), velocity_base_mps=np.array([0.0, 0.1, 0.0]))
    first, second, both = (
        rank_grasps(ARM, row, object_at(0.5), ARM.home_q_rad, method, BACK_M, aids).tolist()
        for method in ("reachability", "motion", "both")
    )
    assert both == list(dict.fromkeys(first[:5] + second[:5]))
    assert set(both) == set(first[:5]) | set(second[:5])


def test_ours_prefers_the_more_robust_of_equals_and_the_nearer_of_equals():
    twins = grasps((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), successes=[30, 50])
    assert rank_grasps(ARM, twins, object_at(0.5), ARM.home_q_rad, "ours", BACK_M).tolist() == [1, 0]
    apart = grasps((0.0, 0.4, 0.0), (0.0, 0.0, 0.0))
    assert rank_grasps(ARM, apart, object_at(0.5), ARM.home_q_rad, "ours", BACK_M).tolist() == [1, 0]


def test_what_touches_an_obstacle_is_not_ranked():
    wall = box("wall", (0.05, 0.4, 0.6), object_at(0.75, 0.0, 0.3))
    aids = RankingAids(collisions=CollisionModel(ARM, [wall]))
    near = grasps((0.0, 0.0, 0.0), (0.25, 0.0, 0.0))
    assert rank_grasps(ARM, near, object_at(0.5), ARM.home_q_rad, "ours", BACK_M).tolist() == [0, 1]
    assert rank_grasps(ARM, near, object_at(0.5), ARM.home_q_rad, "ours", BACK_M, aids).tolist() == [0]


def test_no_such_ranking_names_the_nearest():
    with pytest.raises(GraspError, match="did you mean 'nearness'"):
        rank_grasps(ARM, grasps(*SPREAD), object_at(0.5), ARM.home_q_rad, "nearnes", BACK_M)  # type: ignore[arg-type]
