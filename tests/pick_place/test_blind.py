"""The task on the fake, where every device does as it is told or fails on cue."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from tr_grasp.hardware import Fault, Guard, GuardCfg, KinematicFake
from tr_grasp.motion import Kinematics
from tr_grasp.pick_place import BlindPickPlace, BoxCfg, PlanningScene, TaskOutcome, plan_stages, read_station
from tr_grasp.robots import robot_spec


@pytest.fixture(scope="module")
def cfg():
    # From the fake's own home, with the thesis' poses and walls.
    return replace(read_station("thesis"), home_q_rad=robot_spec("j2s7s300").home_q_rad)


@pytest.fixture(scope="module")
def plan(cfg):
    scene = PlanningScene(cfg)
    return scene, plan_stages(scene, scene.home_q, cfg.stages)


def devices(blocked_at_m=0.06, faults=()):
    station = KinematicFake.of(robot_spec("j2s7s300"), faults=faults)
    station.gripper.blocked_at_m = blocked_at_m
    return station


def test_every_stage_is_planned_from_where_the_one_before_ends(cfg, plan):
    scene, found = plan
    assert found.succeeded
    assert [step.stage for step in found.stages] == list(cfg.stages)
    moving = [step for step in found.stages if step.trajectory is not None]
    for before, after in pairwise(moving):
        assert before.trajectory.q_rad[-1] == pytest.approx(after.trajectory.q_rad[0])
    for step in moving:
        assert not step.trajectory.violations(scene.limits, margin=0.01)
    reached = {step.stage.name: scene.empty_hand.pose(step.trajectory.q_rad[-1]) for step in moving}
    assert reached["grasp"] == pytest.approx(scene.goal("grasp"), abs=2e-3)
    assert reached["place"] == pytest.approx(scene.goal("place"), abs=2e-3)


def test_nothing_that_is_planned_touches_a_box_even_with_the_bottle_in_the_hand(plan):
    scene, found = plan
    models = {"pre-grasp": scene.before_grip, "place": scene.full_hand, "home again": scene.at_object}
    for step in found.stages:
        if step.stage.name in models:
            assert models[step.stage.name].first_contact(step.trajectory) is None


def test_the_bottle_in_the_hand_counts_as_the_arms(plan):
    """A wall where only the bottle would be is a contact for the full hand alone."""
    scene, _ = plan
    x, y, _ = scene.station.object.foot_m
    slab = BoxCfg(size_m=(0.02, 0.02, 0.02), centre_m=(x, y, 0.05))
    with_slab = PlanningScene(replace(scene.station, boxes={**scene.station.boxes, "slab": slab}))
    found = plan_stages(with_slab, with_slab.home_q, with_slab.station.stages[:3])
    q = found.stages[-1].trajectory.q_rad[-1]
    assert with_slab.at_object.free(q)[0]
    assert str(with_slab.full_hand.contact(q)) == "held_object touches slab"


def test_a_dry_run_moves_nothing(cfg):
    station = devices()
    before = station.arm.state().q_rad
    found = BlindPickPlace(cfg, station).dry_run()
    assert found.succeeded
    assert station.world.now_s == 0.0
    assert station.arm.state().q_rad == pytest.approx(before)


def test_all_nine_stages_are_carried_out(cfg):
    station, seen = devices(), []
    result = BlindPickPlace(cfg, station, watch=lambda record: seen.append(record.name)).run()
    assert result.outcome is TaskOutcome.DONE
    assert seen == [stage.name for stage in cfg.stages]
    assert result.cycle_s == pytest.approx(station.world.now_s, abs=0.1)
    assert station.arm.state().q_rad == pytest.approx(cfg.home_q_rad, abs=1e-3)


def test_fingers_that_close_on_nothing_try_again_deeper_and_say_so(cfg):
    station = devices(blocked_at_m=None)
    tips = []

    def watch(record):
        if record.name == "grasp":
            tips.append(Kinematics(robot_spec("j2s7s300")).pose(station.arm.state().q_rad)[:3, 3])
        if record.name == "back off":
            station.gripper.blocked_at_m = 0.06

    result = BlindPickPlace(cfg, station, watch=watch).run()
    assert result.outcome is TaskOutcome.DONE
    assert result.retries == ("close: the fingers are 0 mm apart",)
    assert np.linalg.norm(tips[1] - tips[0]) == pytest.approx(0.010, abs=2e-3)


def test_retries_come_to_an_end(cfg):
    result = BlindPickPlace(cfg, devices(blocked_at_m=None)).run(retries_n=0)
    assert result.outcome is TaskOutcome.MISSED
    assert "closed on nothing" in result.reason


def test_a_bottle_lost_on_the_way_ends_the_task(cfg):
    station = devices()

    def watch(record):
        if record.name == "post-grasp":
            station.gripper.blocked_at_m = None
            station.gripper.move(0.0)

    result = BlindPickPlace(cfg, station, watch=watch).run()
    assert result.outcome is TaskOutcome.DROPPED
    assert result.stages[-1].name == "place"


def test_an_arm_that_fails_in_motion_is_stopped_with_its_reason(cfg):
    result = BlindPickPlace(cfg, devices(faults=(Fault("emergency_stop", 2.0),))).run()
    assert result.outcome is TaskOutcome.NOT_MOVED
    assert "emergency stop" in result.stages[-1].reason


def test_a_wall_in_the_way_is_named_before_anything_moves(cfg):
    x, y, z = PlanningScene(cfg).goal("grasp")[:3, 3]
    wall = BoxCfg(size_m=(0.5, 0.02, 0.5), centre_m=(float(x), float(y) + 0.06, float(z)))
    station = devices()
    result = BlindPickPlace(replace(cfg, boxes={**cfg.boxes, "new wall": wall}), station).run()
    assert result.outcome is TaskOutcome.NO_PLAN
    assert "grasp" in result.reason
    assert "new wall" in result.reason
    assert station.world.now_s == 0.0


def test_a_station_out_of_reach_is_a_result_too(cfg):
    away = replace(cfg.poses["place"], position_m=(-1.5, -0.5, 0.7))
    result = BlindPickPlace(replace(cfg, poses={**cfg.poses, "place": away}), devices()).run()
    assert result.outcome is TaskOutcome.NO_PLAN
    assert "place: no joint angles" in result.reason


def test_a_guard_that_stops_everything_is_reported(cfg):
    spec = robot_spec("j2s7s300")
    box = ((-0.1, -1.0, 0.0), (1.0, 1.0, 1.0))
    guard = Guard(devices(), Kinematics(spec), GuardCfg(workspace_m=box))
    result = BlindPickPlace(cfg, guard.station).run()
    assert result.outcome is TaskOutcome.NOT_MOVED
    assert "leave the workspace" in result.reason
