"""What follows a meeting, and what the arm may not touch: stations, fine checks of motions, ways out of contacts."""

from __future__ import annotations

import numpy as np
import pytest

from tests.dynamic.stations import OBJECT, arm, at, line, parts, scene
from tr_grasp.dynamic import DynamicGrasper, GraspOutcome
from tr_grasp.dynamic.course import CLOSED, FEW, GRASP, MANY, Course
from tr_grasp.dynamic.scene import Scene
from tr_grasp.dynamic.step_out import STEP_OUT_RAD, step_out
from tr_grasp.dynamic.target import Forecast
from tr_grasp.dynamic.tool_path import moved_along_tool
from tr_grasp.geometry import rotation_about_z, transform_from
from tr_grasp.hardware import Follower
from tr_grasp.motion import CollisionModel, JointState, MotionLimits, Obstacle, box, inverse_kinematics, point_to_point
from tr_grasp.robots import robot_spec

RATED = MotionLimits.of(robot_spec("ur5_robotiq_2f85"))
HEIGHT_M = 0.02 - float(parts(OBJECT)[1].bounds_m[0, 2])
LIFT_M, BACK_M = 0.07, 0.075


def still(x: float, y: float) -> Forecast:
    times = np.array([0.0, 30.0])
    return Forecast(times, np.tile([x, y, HEIGHT_M], (2, 1)), np.zeros((2, 3)), np.zeros(2), np.full(2, 0.7), np.eye(3))


def scene_with(*obstacles: Obstacle, forecast: Forecast) -> Scene:
    found = Scene.of(arm(), scene(line(), obstacles=obstacles)[1], arm().home_q_rad)
    found.expect(forecast)
    return found


def sideways_grasp(forecast: Forecast) -> tuple[np.ndarray, np.ndarray]:
    """``T_obj_tcp`` of a level grasp that is free all along, and joints at its pre-grasp."""
    course = Course(scene_with(forecast=forecast), BACK_M, 0.6, LIFT_M)
    T_all = parts(OBJECT)[1].grasps.poses()
    T = T_all[np.abs(T_all[:, 2, 2]) < 0.2]
    q = inverse_kinematics(arm(), moved_along_tool(forecast.poses(np.zeros(1)) @ T, BACK_M), arm().home_q_rad).q_rad
    T, q = T[np.isfinite(q).all(-1)], q[np.isfinite(q).all(-1)]
    now = np.zeros(len(q))
    free = course.is_free(forecast, T, q, now, FEW) & course.is_free(forecast, T, q, now, MANY)
    at_grasp = inverse_kinematics(arm(), forecast.poses(np.zeros(1)) @ T, q).q_rad
    free &= ~course.scene.way.free(at_grasp, 0.0)  # and nearer to the object than the arm may be on its way
    assert free.any()
    return T[free][:1], q[free][:1]


def test_a_board_above_the_hand_forbids_the_lift_but_not_the_grasp() -> None:
    forecast = still(0.5, 0.0)
    T, q = sideways_grasp(forecast)
    x, y, z = (forecast.poses(np.zeros(1)) @ T)[0, :3, 3]
    boards = [box("board", (0.08, 1.0, 0.02), at(x, y, z + up)) for up in np.arange(0.0, 0.5, 0.01)]
    courses = [Course(scene_with(board, forecast=forecast), BACK_M, 0.6, LIFT_M) for board in boards]
    free = {
        stations: [bool(course.is_free(forecast, T, q, np.zeros(1), stations)[0]) for course in courses]
        for stations in ((GRASP,), FEW, MANY)
    }
    lowest = free[(GRASP,)].index(True)
    assert free[MANY].index(True) == pytest.approx(lowest + 7, abs=1)  # cm: the lift
    assert free[FEW][lowest]  # the fingers have passed through it, which few stations do not show
    assert not free[MANY][lowest]


def test_what_comes_into_the_way_only_while_the_fingers_close_is_foreseen() -> None:
    """The object rides for a second more; something is then where the hand will be, and not yet where it is before."""
    times, speed = np.array([0.0, 30.0]), np.array([0.0, 0.1, 0.0])
    path = np.array([0.5, -0.1, HEIGHT_M]) + times[:, None] * speed
    moving = Forecast(times, path, np.tile(speed, (2, 1)), np.zeros(2), np.full(2, 0.7), np.eye(3))
    T, q = sideways_grasp(moving)
    palm = (moving.poses(np.array([1.6])) @ moved_along_tool(T, 0.1))[0, :3, 3]
    posts = [
        box("post", (0.02, 0.02, 0.02), at(palm[0], palm[1] + ahead, palm[2])) for ahead in np.arange(0, 0.2, 0.01)
    ]
    courses = [Course(scene_with(post, forecast=moving), BACK_M, 0.6, LIFT_M) for post in posts]
    first, then = (
        [bool(course.is_free(moving, T, q, np.zeros(1), stations)[0]) for course in courses]
        for stations in ((GRASP,), (GRASP, CLOSED))
    )
    assert any(a and not b for a, b in zip(first, then, strict=True))
    assert not any(b and not a for a, b in zip(first, then, strict=True))


def test_a_quick_motion_does_not_pass_through_a_thin_board_unseen() -> None:
    """At full speed the hand moves by 6 cm in 40 ms; fingers and board are thinner, margins included."""
    start_q = arm().home_q_rad + np.array([0, 0, 0, 0, 0, np.pi / 2])
    tool = arm().pose(start_q)
    goal_q = start_q + np.array([3.0, 0, 0, 0, 0, 0])
    way = point_to_point(JointState.at_rest(start_q), JointState.at_rest(goal_q), RATED).trajectory
    assert way is not None
    assert scene_with(forecast=still(0.2, 0.9)).is_free(way, 0.0)
    for turn_rad in np.linspace(1.2, 1.6, 8):
        turn = rotation_about_z(turn_rad)
        board = box("board", (0.12, 0.005, 0.01), transform_from(turn, turn @ tool[:3, 3]))
        assert not scene_with(board, forecast=still(0.2, 0.9)).is_free(way, 0.0)


def test_what_was_to_be_over_by_now_is_still_checked_where_the_arm_is() -> None:
    """A hand that waits to be aligned may be later than its approach was to end."""
    forecast = still(0.5, 0.0)
    T, q = sideways_grasp(forecast)
    z = float((forecast.poses(np.zeros(1)) @ moved_along_tool(T, BACK_M))[0, 2, 3])
    x, y = arm().pose(q[0])[:2, 3]
    rest = point_to_point(JointState.at_rest(q[0]), JointState.at_rest(q[0] + 0.01), RATED).trajectory
    assert rest is not None
    assert scene_with(forecast=forecast).is_free_at_grasp(rest, 5.0, 4.0)
    board = box("board", (0.3, 0.3, 0.01), at(x, y, z))
    touching = Scene.of(arm(), scene(line(), obstacles=[board])[1], arm().home_q_rad)
    touching.expect(forecast)
    assert not touching.is_free_at_grasp(rest, 5.0, 4.0)


def test_an_arm_that_is_only_near_to_something_at_first_still_minds_it() -> None:
    tool = arm().pose(arm().home_q_rad)
    tops = [box("top", (0.3, 0.3, 0.02), at(*tool[:2, 3], tool[2, 3] - gap)) for gap in np.arange(0.0, 0.2, 0.002)]
    near = next(top for top in tops if CollisionModel(arm(), [top]).contact(arm().home_q_rad) is None)
    found = scene_with(near, forecast=still(0.5, 0.4))
    assert found.way.free(arm().home_q_rad)[0]  # it is within the margin and may stand there
    lower = tool.copy()
    lower[2, 3] -= 0.01
    q = inverse_kinematics(arm(), lower, arm().home_q_rad).q_rad
    assert not found.way.free(q)[0]


def test_the_step_out_of_a_contact_is_short_and_free() -> None:
    forecast = still(0.5, 0.0)
    T, _ = sideways_grasp(forecast)
    q = inverse_kinematics(arm(), forecast.poses(np.zeros(1)) @ T, arm().home_q_rad).q_rad[0]
    way = scene_with(forecast=forecast).way
    assert not way.free(q)[0]
    out = step_out(way, RATED, q, 0.0, np.random.default_rng(0))
    assert out is not None
    assert way.free(out)[0]
    assert np.abs(out - q).max() <= STEP_OUT_RAD
    rng = np.random.default_rng(0)
    tried = q + rng.uniform(-STEP_OUT_RAD, STEP_OUT_RAD, (100, 6))
    nearest = min((row for row in tried if way.free(row)[0]), key=lambda row: np.abs(row - q).sum())
    np.testing.assert_allclose(out, nearest)


def test_a_hand_that_stands_around_the_object_at_first_steps_out_and_grasps() -> None:
    """Every way is blocked from its beginning; that is no reason to give up."""
    station, task = scene(line())
    forecast = still(0.5, -0.3)
    T, _ = sideways_grasp(forecast)
    q = inverse_kinematics(arm(), forecast.poses(np.zeros(1)) @ T, arm().home_q_rad).q_rad[0]
    station.arm._follower = Follower(station.arm.limits, q, lambda: station.world.now_s)
    assert DynamicGrasper().run(station, task).outcome is GraspOutcome.LIFTED
