"""The parts of the intercept planner: least times, forecasts, tool paths, scenes, rankings and the search."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.dynamic.stations import OBJECT, arm, at, line, parts, scene
from tr_grasp.dynamic.approach import approach_time_s
from tr_grasp.dynamic.around import way_around
from tr_grasp.dynamic.intercept import InterceptSearch
from tr_grasp.dynamic.meeting import HALF_TURN, Candidates
from tr_grasp.dynamic.reach_time import least_time, turning_time
from tr_grasp.dynamic.scene import Scene, hand_links
from tr_grasp.dynamic.target import Forecast, Target
from tr_grasp.dynamic.tool_path import follow, moved_along_tool
from tr_grasp.errors import GraspError
from tr_grasp.grasps.ranking import rank_grasps
from tr_grasp.hardware import PoseReading
from tr_grasp.motion import JointState, MotionLimits, box, inverse_kinematics, point_to_point
from tr_grasp.prediction.kalman import ConstantVelocityPredictor
from tr_grasp.robots import robot_spec

RATED = MotionLimits.of(robot_spec("ur5_robotiq_2f85"))
ONE = MotionLimits([-9.0], [9.0], [1.0], [2.0], [1e4])
THESIS = MotionLimits.of(robot_spec("ur5_robotiq_2f85"), "thesis")
numbers = st.floats(-2.0, 2.0)


def straight(velocity=(0.0, 0.03, 0.0), start=(0.5, -0.3, 0.1), sigma_m=0.0) -> Forecast:
    times = np.arange(0.0, 30.0, 0.5)
    p = np.asarray(start) + times[:, None] * np.asarray(velocity)
    n = len(times)
    return Forecast(times, p, np.tile(velocity, (n, 1)), np.full(n, sigma_m), np.full(n, 0.7), np.eye(3))


def test_a_trapezoid_worked_by_hand() -> None:
    """2 rad at 1 rad/s and 2 rad/s²: half a second to speed up, as long to brake, 1.5 s between."""
    rest = JointState.at_rest([0.0])
    assert least_time(rest, np.array([2.0]), np.zeros(1), ONE) == pytest.approx(2.5)
    assert least_time(rest, np.array([0.125]), np.zeros(1), ONE) == pytest.approx(0.5)  # never at full speed
    assert np.isinf(least_time(rest, np.array([np.nan]), np.zeros(1), ONE))


def test_how_long_half_a_turn_and_the_approach_take_follows_from_the_limits() -> None:
    """0.06 m are 0.2 rad; half of 2 rad/s² bounds 5.77 · 0.2 rad / t², half of 1 rad/s 1.875 · 0.2 rad / t."""
    assert turning_time(2.0, ONE) == pytest.approx(2.5)
    assert approach_time_s(ONE, 0.06) == pytest.approx(np.sqrt(5.7735 * 0.2), rel=1e-4)
    slow = MotionLimits([-9.0], [9.0], [0.1], [2.0], [1e4])
    assert approach_time_s(slow, 0.06) == pytest.approx(1.875 * 0.2 / 0.05)


@settings(max_examples=40, deadline=None)
@given(q=numbers, v0=st.floats(-1.0, 1.0), v1=st.floats(-1.0, 1.0))
def test_no_motion_is_faster_than_the_least_time_and_almost_unlimited_jerk_reaches_it(q, v0, v1) -> None:
    start = JointState(np.zeros(1), np.array([v0]), np.zeros(1))
    bound = float(least_time(start, np.array([q]), np.array([v1]), ONE))
    found = point_to_point(start, JointState(np.array([q]), np.array([v1]), np.zeros(1)), ONE).trajectory
    if found is not None:
        assert bound <= found.duration_s + 1e-3
        assert found.duration_s <= 1.05 * bound + 0.02


def test_a_forecast_passes_through_its_points_and_goes_straight_on_after_them() -> None:
    found = straight()
    position, velocity = found.states(np.array([0.25, 40.0]))
    np.testing.assert_allclose(position, [[0.5, -0.2925, 0.1], [0.5, 0.9, 0.1]], atol=1e-12)
    np.testing.assert_allclose(velocity, [[0.0, 0.03, 0.0]] * 2, atol=1e-12)
    T = found.poses(np.array([1.0]))[0]
    np.testing.assert_allclose(T[:2, 0], [np.cos(0.7), np.sin(0.7)])


class Readings:
    """A world that gives readings."""

    def __init__(self, *readings: PoseReading) -> None:
        self.readings = readings

    def poses(self, name, after_s):
        return tuple(reading for reading in self.readings if reading.stamp_s > after_s)


def test_a_target_forgets_what_was_before_a_leap_and_ignores_what_is_nan() -> None:
    target = Target("it", ConstantVelocityPredictor())
    steps = [PoseReading(t, at(0.5, 0.1 * t, 0.1)) for t in np.arange(0, 1, 0.1)]
    broken = PoseReading(1.0, np.full((4, 4), np.nan))
    leapt = [PoseReading(t, at(0.5, 0.8, 0.1)) for t in np.arange(1.1, 2.0, 0.1)]
    target.look(Readings(*steps, broken, *leapt))
    assert target.leaps_n == 1
    assert target.seen_s == pytest.approx(1.9)
    np.testing.assert_allclose(target.forecast(2.0, 4.0).states(np.array([4.0]))[0][0], [0.5, 0.8, 0.1], atol=1e-3)


def test_without_looking_ahead_the_object_stays() -> None:
    target = Target("it", ConstantVelocityPredictor(), looks_ahead=False)
    target.look(Readings(*(PoseReading(t, at(0.5, 0.1 * t, 0.1)) for t in np.arange(0, 1, 0.1))))
    np.testing.assert_allclose(target.forecast(1.0, 3.0).states(np.array([3.0]))[0][0], [0.5, 0.09, 0.1], atol=1e-9)


def test_the_tool_comes_onto_a_moving_pose_within_the_limits_and_stays_on_it() -> None:
    tool = arm().pose(arm().home_q_rad)

    def poses(times):
        rows = np.tile(tool, (len(times), 1, 1))
        rows[:, 1, 3] += 0.02 + 0.05 * np.asarray(times)
        return rows

    start = JointState.at_rest(arm().home_q_rad)
    path = follow(arm(), RATED, poses, start, 0.0, 1.5)
    assert path is not None
    assert not path.violations(RATED)
    times = np.array([0.9, 1.23])
    reached = arm().pose(path.sample(times).q)[:, :3, 3]
    np.testing.assert_allclose(reached, poses(times)[:, :3, 3], atol=2e-4)
    assert follow(arm(), RATED, lambda times: poses(np.asarray(times) * 100), start, 0.0, 1.5) is None


def searcher(forecast: Forecast, *obstacles, limits: MotionLimits = RATED) -> tuple[InterceptSearch, Scene]:
    _, task = scene(line(), obstacles=obstacles)
    found = Scene.of(arm(), task, arm().home_q_rad)
    found.expect(forecast)
    candidates = Candidates.of(task.grasps, np.arange(len(task.grasps)))
    return InterceptSearch(found, limits, candidates, 0.075, 10.0, 0.6, 0.07), found


def resting_height() -> float:
    return 0.02 - float(parts(OBJECT)[1].bounds_m[0, 2])


def test_a_meeting_is_at_the_pre_grasp_when_the_object_is_there() -> None:
    forecast = straight(start=(0.5, -0.3, resting_height()))
    search, found_scene = searcher(forecast)
    best = search.search(forecast, JointState.at_rest(arm().home_q_rad), 0.0).best
    assert best is not None
    wanted = moved_along_tool(forecast.poses(np.array([best.arrival_s])) @ best.T_obj_tcp, 0.075)[0]
    end = best.way.end
    np.testing.assert_allclose(arm().pose(end.q), wanted, atol=2e-3)
    np.testing.assert_allclose(arm().tcp_velocity(end.q, end.dq)[:3], [0.0, 0.03, 0.0], atol=2e-3)
    assert best.way.duration_s == pytest.approx(best.arrival_s, abs=0.02)
    assert not best.way.violations(RATED)
    assert found_scene.is_free(best.way, 0.0)


def rest_of(way, at_s: float) -> JointState:
    state = way.sample(at_s)
    return JointState(state.q, state.dq, state.ddq)


def test_a_slow_arm_that_aims_again_all_the_time_arrives_when_it_said_at_first() -> None:
    """On the last reserve of its limits it would overshoot by a hair, and come seconds later."""
    forecast = straight(start=(0.5, -0.3, resting_height()))
    search, _ = searcher(forecast, limits=THESIS)
    first = meeting = search.search(forecast, JointState.at_rest(arm().home_q_rad), 0.0).best
    assert meeting is not None
    assert meeting.arrival_s > 3.0
    for now_s in np.arange(0.175, meeting.arrival_s - 0.3, 0.175):
        meeting = search.again(forecast, rest_of(meeting.way, now_s - meeting.start_s), now_s, meeting)
        assert meeting is not None
        assert not meeting.way.violations(THESIS)
    assert meeting.arrival_s == pytest.approx(first.arrival_s)
    assert meeting.start_s + meeting.way.duration_s == pytest.approx(first.arrival_s, abs=0.01)


def test_what_can_be_met_much_sooner_is_and_what_moved_on_is_met_there() -> None:
    said = straight(start=(0.5, -0.3, resting_height()))
    search, found_scene = searcher(said, limits=THESIS)
    meeting = search.search(said, JointState.at_rest(arm().home_q_rad), 0.0).best
    assert meeting is not None
    start = rest_of(meeting.way, 0.5)
    sooner = search.again(said, start, 0.5, replace(meeting, arrival_s=meeting.arrival_s + 3.0))
    assert sooner is not None
    assert sooner.arrival_s == pytest.approx(meeting.arrival_s, abs=0.3)

    quicker = straight((0.0, 0.032, 0.0), (0.5, -0.3, resting_height()))
    found_scene.expect(quicker)
    there = search.again(quicker, start, 0.5, meeting)
    assert there is not None
    wanted = moved_along_tool(quicker.poses(np.array([there.arrival_s])) @ there.T_obj_tcp, 0.075)[0]
    np.testing.assert_allclose(arm().pose(there.way.end.q), wanted, atol=2e-3)


def test_an_unsure_forecast_costs_time_and_a_slow_arm_arrives_later() -> None:
    start = JointState.at_rest(arm().home_q_rad)
    sure = straight(start=(0.5, -0.3, resting_height()))
    costs = []
    for forecast, limits in (
        (sure, RATED),
        (replace(sure, sigma_m=sure.sigma_m + 0.1), RATED),
        (sure, RATED.scaled(0.2)),
    ):
        best = searcher(forecast, limits=limits)[0].search(forecast, start, 0.0).best
        assert best is not None
        costs.append(best.cost_s)
    assert costs[1] - costs[0] == pytest.approx((1.645 * 0.1 - 0.04) / 0.15, abs=0.25)
    assert costs[2] > costs[0]


def test_what_is_out_of_reach_or_gone_too_soon_has_no_meeting() -> None:
    start = JointState.at_rest(arm().home_q_rad)
    far = straight(start=(2.0, 0.0, resting_height()))
    found = searcher(far)[0].search(far, start, 0.0)
    assert (found.reachable_n, found.best) == (0, None)
    fast = straight(velocity=(0.0, 3.0, 0.0), start=(0.5, -0.3, resting_height()))
    found = searcher(fast)[0].search(fast, start, 0.0)
    assert found.in_time_n == 0


def test_candidates_hold_the_object_either_way_round() -> None:
    _, grasps = parts()
    candidates = Candidates.of(grasps, np.array([3, 5]))
    assert len(candidates) == 4
    np.testing.assert_allclose(candidates.T_obj_tcp[2], candidates.T_obj_tcp[0] @ HALF_TURN)
    assert candidates.number.tolist() == [3, 5, 3, 5]


def test_the_hand_may_be_closer_to_the_object_at_the_grasp_than_on_the_way() -> None:
    forecast = straight(velocity=(0.0, 0.0, 0.0), start=(0.5, 0.0, resting_height()))
    _, found_scene = searcher(forecast)
    T = forecast.poses(np.zeros(1)) @ parts()[1].grasps.poses()
    q = inverse_kinematics(arm(), T, arm().home_q_rad).q_rad
    q = q[np.isfinite(q).all(-1)]
    on_the_way, at_the_grasp = found_scene.way.free(q, 0.0), found_scene.grasp.free(q, 0.0)
    assert (at_the_grasp & ~on_the_way).any()
    assert not (on_the_way & ~at_the_grasp).any()
    assert "forearm_link" not in hand_links(arm())


def test_an_arm_that_leans_on_something_at_first_may_leave_it() -> None:
    tool = arm().pose(arm().home_q_rad)
    block = box("block", (0.05, 0.05, 0.05), at(*tool[:3, 3]))
    forecast = straight(start=(0.5, 0.4, resting_height()))
    _, found_scene = searcher(forecast, block)
    assert found_scene.way.free(arm().home_q_rad, 0.0)[0]


def test_a_wall_in_the_way_is_gone_around() -> None:
    wall = box("wall", (0.6, 0.02, 0.5), at(0.6, 0.0, 0.25))
    forecast = straight(velocity=(0.0, 0.0, 0.0), start=(0.9, 0.9, resting_height()))
    _, found_scene = searcher(forecast, wall)
    sides = np.stack([at(0.45, y, 0.25) for y in (-0.25, 0.25)])
    sides[:, :3, :3] = arm().pose(arm().home_q_rad)[:3, :3]
    q = inverse_kinematics(arm(), sides, arm().home_q_rad).q_rad
    assert not found_scene.way.all_free(np.linspace(q[0], q[1], 60), 0.0)
    found = way_around(found_scene, RATED, JointState.at_rest(q[0]), 0.0, q[1], 2.0)
    assert found is not None
    assert found_scene.is_free(found[1], 0.0)
    np.testing.assert_allclose(found[1].end.q, q[1], atol=1e-6)


def test_rankings_name_reachable_grasps_and_both_joins_the_halves() -> None:
    _, grasps = parts()
    T, q = at(0.5, 0.0, resting_height()), arm().home_q_rad
    ranked = {
        name: rank_grasps(arm(), grasps, T, q, name, 0.075) for name in ("reachability", "nearness", "both", "ours")
    }
    assert set(ranked["reachability"]) == set(ranked["nearness"]) == set(ranked["ours"])
    assert set(ranked["both"]) == {*ranked["reachability"][:5], *ranked["nearness"][:5]}
    assert rank_grasps(arm(), grasps, T, q, "none", 0.075).tolist() == list(range(len(grasps)))
    assert len(rank_grasps(arm(), grasps, at(3.0, 0.0, 0.1), q, "ours", 0.075)) == 0
    with pytest.raises(GraspError, match="unknown ranking 'neraness'"):
        rank_grasps(arm(), grasps, T, q, "neraness", 0.075)


def test_the_nearest_grasp_is_nearest_by_a_plain_loop() -> None:
    _, grasps = parts()
    T, q = at(0.5, 0.0, resting_height()), arm().home_q_rad
    ways = []
    for T_obj_tcp in grasps.grasps.poses():
        pre = moved_along_tool(T @ T_obj_tcp, 0.075)
        found = inverse_kinematics(arm(), pre, q)
        ways.append(np.linalg.norm(found.q_rad - q) if found.found else np.inf)
    assert rank_grasps(arm(), grasps, T, q, "nearness", 0.075)[0] == int(np.argmin(ways))
