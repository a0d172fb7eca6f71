"""Trials of Task II as data."""

import json

import numpy as np
import pytest
import torch

from tr_grasp.configs.dynamic import ChargesCfg, DynamicCfg, JudgeCfg, TrackingCfg
from tr_grasp.envs.dynamic_grasp import DYNAMIC_MOTIONS, Trial, make_trial
from tr_grasp.envs.dynamic_grasp.obstacles import CLEAR_M, OBSTACLES, Line, Standing, known_object
from tr_grasp.envs.dynamic_grasp.ride import Ride
from tr_grasp.errors import ConfigError

MUSTARD, DRILL = "006_mustard_bottle", "035_power_drill"


def corners(model, x, y, yaw):
    points = np.concatenate([part.vertices for part in model.parts])[:, :2]
    c, s = np.cos(yaw), np.sin(yaw)
    return points @ np.array([[c, s], [-s, c]]) + [x, y]


@pytest.mark.parametrize("motion", DYNAMIC_MOTIONS)
def test_a_trial_is_decided_by_its_number_and_seed_and_survives_json(motion):
    trial = make_trial(motion, MUSTARD, 3, seed=5)
    assert trial == make_trial(motion, MUSTARD, 3, seed=5)
    others = [make_trial(motion, MUSTARD, 4, 5), make_trial(motion, MUSTARD, 3, 6), make_trial(motion, DRILL, 3, 5)]
    assert all(other.parameters != trial.parameters for other in others)
    assert Trial.from_json(json.loads(json.dumps(trial.as_json()))) == trial
    assert float(trial.path(0.03).duration_s[0]) > 5.0
    faster, slower = trial.path(0.06), trial.path(0.03)
    assert torch.allclose(faster.at(2.0).position, slower.at(4.0).position)


def test_cases_that_differ_in_what_is_in_the_way_share_their_path():
    linear, *others = (
        make_trial(name, DRILL, 0) for name in ("linear", "linear_obstacles", "linear_slab", "varying_speed")
    )
    assert all(other.parameters == linear.parameters for other in others)
    sine = make_trial("sinusoidal", DRILL, 0)
    assert {name: sine.parameters[name] for name in linear.parameters} == linear.parameters
    assert [bool(trial.obstacles) for trial in (linear, *others)] == [False, True, False, False]
    assert [trial.has_slab for trial in (linear, *others)] == [False, False, True, False]


def test_obstacles_stand_in_regions_of_their_own_and_leave_the_near_middle_and_the_way_free():
    seen = set()
    for number in range(40):
        trial = make_trial("linear_obstacles", DRILL, number)
        line = trial.line
        assert [one.name for one in trial.obstacles] == list(OBSTACLES)
        outward = np.array([np.cos(line.theta_rad), np.sin(line.theta_rad)])
        along = np.array([-outward[1], outward[0]])
        target = corners(known_object(DRILL).model, 0.0, 0.0, trial.yaw_rad) @ outward
        regions = []
        for one in trial.obstacles:
            place = np.array([one.x_m, one.y_m])
            offset, way = place @ outward - line.distance_m, place @ along
            assert 0.15 - 1e-9 <= abs(offset) <= 0.25 + 1e-9
            third = round(way / 0.35)
            assert abs(way - 0.35 * third) <= 0.15 + 1e-9
            regions.append((int(np.sign(offset)), third))
            reach = corners(known_object(one.name).model, *place, one.yaw_rad) @ outward - line.distance_m
            gap = reach.min() - target.max() if offset > 0 else target.min() - reach.max()
            assert gap >= CLEAR_M - 1e-9
        assert len(set(regions)) == 3
        seen |= set(regions)
    assert seen == {(1, -1), (1, 0), (1, 1), (-1, -1), (-1, 1)}


def test_a_point_beside_a_line_by_hand():
    x, y = Line(0.5, np.pi / 2).point(0.2, 0.1)
    assert (x, y) == pytest.approx((-0.1, 0.7))


def test_a_ride_is_the_motion_at_its_steps_and_can_be_frozen():
    trial = make_trial("rotating", MUSTARD, 0)
    path = trial.path(0.05)
    ride = Ride(path, 0.01)
    times = np.array([0.0, 1.0, 2.5])
    state = path.at(torch.tensor(times).unsqueeze(-1))
    poses = ride(times)
    assert np.allclose(poses[:, :3, 3], state.position[:, 0].numpy(), atol=1e-9)
    turned = float(state.yaw[2, 0] - state.yaw[0, 0])
    assert np.allclose(poses[2, :2, 0], [np.cos(turned), np.sin(turned)])
    assert np.array_equal(poses[1:2], ride(times[1:2]))
    assert np.linalg.norm(ride.velocity) == pytest.approx(0.05)
    ride.freeze(1.0)
    assert np.array_equal(ride(times)[2], poses[1])
    assert np.array_equal(ride(np.array([1e9]))[0], poses[1])


def test_charges_are_measured_fixed_or_free():
    fixed = ChargesCfg(mode="fixed")
    assert fixed.cost_s("ranking", 9.0) == 0.135
    assert fixed.cost_s("inverse_kinematics", 9.0, calls_n=20) == pytest.approx(0.2)
    assert fixed.cost_s("planning", 9.0) == 0.14
    assert ChargesCfg().cost_s("planning", 9.0) == 9.0
    assert ChargesCfg(mode="free").cost_s("planning", 9.0) == 0.0


@pytest.mark.parametrize(
    ("make", "word"),
    [
        (lambda: make_trial("zigzag", MUSTARD, 0), "unknown motion"),
        (lambda: make_trial("linear", "mug", 0), "unknown object"),
        (lambda: make_trial("linear", MUSTARD, -1), "negative"),
        (lambda: Trial.from_json({"motion": "linear"}), "not a trial"),
        (lambda: DynamicCfg(speed_m_s=0.0), "speed_m_s"),
        (lambda: TrackingCfg(dropout_share=2.0), "dropout_share"),
        (lambda: ChargesCfg(planning_s=-1.0), "planning_s"),
        (lambda: JudgeCfg(lifted_m=0.1), "lifted_m"),
    ],
)
def test_what_makes_no_sense_is_refused(make, word):
    with pytest.raises(ConfigError, match=word):
        make()


def test_an_obstacle_is_a_place_and_a_heading():
    assert Standing("x", 1.0, 2.0, 3.0) == Standing(name="x", x_m=1.0, y_m=2.0, yaw_rad=3.0)
