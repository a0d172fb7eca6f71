"""Free hands in SAPIEN: what holds is held, what cannot hold is not."""

from __future__ import annotations

import numpy as np
import pytest

from tests.grasps.things import brick, grasps_at
from tr_grasp.grasps import Grasps, TrialCfg, floating_gripper, gripper_names
from tr_grasp.grasps.grippers import pad_centre_z_m

pytestmark = pytest.mark.sim
SURE = TrialCfg(shift_m=0.0, turn_deg=0.0, parallel_n=4)


def trials(gripper: str, cfg: TrialCfg = SURE, mass_kg: float = 0.3):
    from tr_grasp.envs.grasp_trials import GraspTrials

    return GraspTrials(brick((0.04, 0.05, 0.12)), mass_kg, gripper, cfg)


def side_grasp(gripper: str, *shift) -> Grasps:
    """Hands level with the centre of mass, whose pads meet its middle; then shifted."""
    spec = floating_gripper(gripper)
    middle = np.array([0.0, pad_centre_z_m(spec, spec.gripper.openness(0.04)), 0.0])
    return grasps_at([middle + np.asarray(offset) for offset in shift or [(0.0, 0.0, 0.0)]])


@pytest.mark.parametrize("gripper", gripper_names())
def test_a_good_grasp_holds_and_one_that_misses_does_not(gripper):
    held = trials(gripper)(side_grasp(gripper, (0, 0, 0), (0.3, 0, 0)), np.random.default_rng(0))
    assert held.tolist() == [True, False]


def test_what_is_too_heavy_for_the_friction_stays_where_it_is():
    held = trials("robotiq_2f85", mass_kg=60.0)(side_grasp("robotiq_2f85"), np.random.default_rng(0))
    assert held.tolist() == [False]


def test_the_same_seed_gives_the_same_outcomes_however_often_the_scene_was_used():
    cfg = TrialCfg(parallel_n=4)
    # At a corner it holds now and then.
    grasps = side_grasp("robotiq_2f85", *[(0.0, 0.012, 0.03)] * 4)
    one, other = trials("robotiq_2f85", cfg), trials("robotiq_2f85", cfg)
    other(side_grasp("robotiq_2f85", (0, 0, 0)), np.random.default_rng(9))
    first, second = (each(grasps, np.random.default_rng(3)) for each in (one, other))
    assert first.tolist() == second.tolist()


def test_more_grasps_than_hands_are_tried_in_turns_and_none_is_none():
    hands = trials("robotiq_2f85")
    grasps = side_grasp("robotiq_2f85", *[(0, 0, 0), (0.3, 0, 0)] * 3)
    assert hands(grasps, np.random.default_rng(0)).tolist() == [True, False] * 3
    assert hands(grasps.subset(np.zeros(0, int)), np.random.default_rng(0)).tolist() == []
