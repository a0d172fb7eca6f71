from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from tests.motion.conftest import at, postures, tool_down
from tr_grasp.errors import MotionError
from tr_grasp.motion import (
    CollisionModel,
    Kinematics,
    Obstacle,
    Outcome,
    Plan,
    Planner,
    PlannerCfg,
    box,
    inverse_kinematics,
)
from tr_grasp.motion.edges import edge_is_free, path_length, points_of, steps_between
from tr_grasp.motion.reuse import rest_of
from tr_grasp.motion.shortcut import shortcut
from tr_grasp.motion.straight import tool_poses

PATIENT = PlannerCfg(time_limit_s=20.0)
ROUNDS = replace(PATIENT, rounds_n=5000)
IN_THE_POST = tool_down(0.57, 0.0, 0.2)
LEFT, RIGHT = tool_down(0.5, 0.3, 0.2), tool_down(0.5, -0.3, 0.2)
READY = np.array([0.6, -1.4, 1.6, -1.77, -1.57, 0.6])
FOLDED = np.array([0.6, -1.5, 2.9, -1.77, -1.57, 0.6])


def turned(pan_rad: float) -> np.ndarray:
    """``READY``, with the whole arm turned about its base."""
    return READY + np.array([pan_rad, 0, 0, 0, 0, 0])


def assert_good(plan: Plan, model: CollisionModel, start: np.ndarray) -> np.ndarray:
    assert plan.outcome is Outcome.OK, plan.reason
    assert plan.path is not None
    assert plan.path[0] == pytest.approx(start)
    # Slow and obvious: four times as fine as it was checked.
    assert all(model.contact(q) is None for q in points_of(plan.path, 0.0125))
    return plan.path


def left_of_the_post(model: CollisionModel) -> np.ndarray:
    plan = Planner(model, PATIENT).plan(READY, LEFT)
    return assert_good(plan, model, READY)[-1]


def test_a_free_straight_line_is_taken(ur5: Kinematics) -> None:
    goal = READY + 0.2
    plan = Planner(CollisionModel(ur5)).plan(READY, goal)
    assert plan.how == "joint"
    assert plan.path == pytest.approx(np.stack([READY, goal]))
    assert plan.length_rad == plan.raw_length_rad == pytest.approx(0.2 * np.sqrt(6))


def test_a_near_tool_goal_is_approached_in_a_straight_line(ur5: Kinematics) -> None:
    model = CollisionModel(ur5)
    T = ur5.pose(READY)
    T[2, 3] -= 0.1
    plan = Planner(model).plan(READY, T)
    path = assert_good(plan, model, READY)
    assert plan.how == "cartesian"
    tools = ur5.pose(path)
    assert np.abs(tools[:, :2, 3] - T[:2, 3]).max() < 1e-4
    assert np.abs(tools[:, :3, :3] - T[:3, :3]).max() < 1e-3
    assert tools[-1] == pytest.approx(T, abs=1e-4)


def test_poses_on_a_line_turn_evenly() -> None:
    T = np.diag([-1.0, -1.0, 1.0, 1.0]) @ at(0.0, 0.0, 0.0)
    T[0, 3] = 0.1
    quarter = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    T[:3, :3] = quarter
    poses = tool_poses(np.eye(4), T, PlannerCfg())
    middle = poses[len(poses) // 2 - 1]
    assert len(poses) == 32
    assert middle[0, 3] == pytest.approx(0.05)
    assert np.arctan2(middle[1, 0], middle[0, 0]) == pytest.approx(np.pi / 4)


def test_a_post_in_the_way_is_gone_around(post_scene: CollisionModel) -> None:
    start = left_of_the_post(post_scene)
    goal = inverse_kinematics(post_scene.kinematics, RIGHT, start).q_rad
    straight = Planner(post_scene).plan(start, goal, mode="joint")
    assert straight.outcome is Outcome.BLOCKED
    assert "touches post" in straight.reason
    plan = Planner(post_scene, PATIENT).plan(start, goal)
    path = assert_good(plan, post_scene, start)
    assert plan.how == "rrt_connect"
    assert path[-1] == pytest.approx(goal)
    assert plan.length_rad <= plan.raw_length_rad + 1e-9


def test_every_arm_finds_its_way(arm: Kinematics) -> None:
    model = CollisionModel(
        arm, [box("table", (2, 2, 0.02), at(0, 0, -0.03)), box("post", (0.1, 0.1, 0.5), at(0.45, 0.25, 0.25))]
    )
    free = [q for q in postures(arm, 60) if model.free(q)[0]][:4]
    for start, goal in pairwise(free):
        plan = Planner(model, PATIENT).plan(start, goal)
        assert plan.outcome is Outcome.OK, plan.reason
        assert plan.path is not None
        assert model.free(points_of(plan.path, 0.025)).all()


def test_the_same_question_has_the_same_answer(post_scene: CollisionModel) -> None:
    start = left_of_the_post(post_scene)
    goal = inverse_kinematics(post_scene.kinematics, RIGHT, start).q_rad
    first, second = (Planner(post_scene, PATIENT).plan(start, goal, mode="rrt_connect") for _ in range(2))
    assert np.array_equal(first.path, second.path)


def test_a_plan_is_reused_when_its_goal_moves(post_scene: CollisionModel) -> None:
    start = left_of_the_post(post_scene)
    planner = Planner(post_scene, PATIENT)
    first_goal = inverse_kinematics(post_scene.kinematics, RIGHT, start).q_rad
    first = planner.plan(start, first_goal)
    assert first.path is not None
    on_the_way = points_of(first.path, 0.05)[4]
    moved = planner.plan(on_the_way, tool_down(0.52, -0.3, 0.2), previous=first)
    path = assert_good(moved, post_scene, on_the_way)
    assert moved.how in ("reused", "repaired")
    # It ends in the posture of the plan before.
    assert np.abs(path[-1] - first_goal).max() < 0.2


def test_a_plan_that_became_blocked_is_repaired(ur5: Kinematics, post_scene: CollisionModel) -> None:
    start = left_of_the_post(post_scene)
    goal = inverse_kinematics(ur5, RIGHT, start).q_rad
    first = Planner(post_scene, PATIENT).plan(start, goal)
    assert first.path is not None
    middle = points_of(first.path, 0.05)
    tool = ur5.pose(middle[len(middle) // 2])[:3, 3]
    changed = CollisionModel(ur5, [*post_scene.obstacles, box("new", (0.06, 0.06, 0.06), at(*tool))])
    if not changed.free(np.stack([start, goal])).all():
        pytest.fail("the new box was meant for the middle of the way")
    plan = Planner(changed, PATIENT).plan(start, goal, previous=first)
    assert_good(plan, changed, start)


def test_the_rest_of_a_path_starts_where_the_arm_is() -> None:
    path = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
    assert rest_of(path, np.array([0.4, 0.1])) == pytest.approx(np.array([[0.4, 0.1], [1.0, 0.0], [1.0, 1.0]]))
    assert rest_of(path, np.array([0.7, 0.0])) == pytest.approx(np.array([[0.7, 0.0], [1.0, 0.0], [1.0, 1.0]]))
    assert rest_of(path, np.array([1.1, 0.9])) == pytest.approx(np.array([[1.1, 0.9], [1.0, 1.0]]))


def test_a_shortcut_is_free_not_longer_and_keeps_the_ends(post_scene: CollisionModel) -> None:
    start = left_of_the_post(post_scene)
    goal = inverse_kinematics(post_scene.kinematics, RIGHT, start).q_rad
    raw = Planner(post_scene, replace(PATIENT, shortcuts_n=1)).plan(start, goal, mode="rrt_connect").path
    assert raw is not None
    detour = np.vstack([raw, raw[-1] + 0.02, raw[-1]])
    short = shortcut(post_scene, detour, 60, 0.05, np.random.default_rng(0))
    assert path_length(short) < path_length(detour)
    assert short[[0, -1]] == pytest.approx(detour[[0, -1]])
    assert post_scene.free(points_of(short, 0.05)).all()


def test_the_points_of_an_edge_are_close_and_complete(ur5: Kinematics) -> None:
    a, b = np.zeros(6), np.array([0.31, -0.1, 0.0, 0.2, 0.0, 0.0])
    assert steps_between(a, b, 0.05) == 7
    points = points_of(np.stack([a, b]), 0.05)
    assert np.abs(np.diff(points, axis=0)).max() <= 0.05
    assert points[[0, -1]] == pytest.approx(np.stack([a, b]))
    # A thin wall that only the middle of the edge meets is not missed.
    start, goal = READY, turned(-1.2)
    tool = ur5.pose((start + goal) / 2)[:3, 3]
    model = CollisionModel(ur5, [box("thin", (0.2, 0.2, 0.2), at(*tool))])
    assert model.free(np.stack([start, goal])).all()
    assert not edge_is_free(model, start, goal, 0.05)


def test_a_posture_that_is_blocked_gives_way_to_another(ur5: Kinematics) -> None:
    nearest, *others = inverse_kinematics(ur5, LEFT, READY).all_of()
    model = CollisionModel(ur5, [box("at the elbow", (0.05,) * 3, at(*ur5.joint_positions(nearest)[3]))])
    start = next(q for q in others if model.free(q)[0]) + turned(-0.3) - READY
    assert model.free(start)[0]
    # As near to the blocked posture as can be: the reference is the end of a plan that went there.
    before = Plan(Outcome.OK, np.stack([start, nearest]))
    plan = Planner(model).plan(start, LEFT, mode="joint", previous=before)
    path = assert_good(plan, model, start)
    assert np.abs(path[-1] - nearest).max() > 0.5
    assert ur5.pose(path[-1]) == pytest.approx(LEFT, abs=1e-4)


def test_a_plan_to_a_posture_that_is_lost_is_forgotten(ur5: Kinematics) -> None:
    nearest, *others = inverse_kinematics(ur5, LEFT, READY).all_of()
    model = CollisionModel(ur5, [box("at the elbow", (0.05,) * 3, at(*ur5.joint_positions(nearest)[3]))])
    start = next(q for q in others if model.free(q)[0]) + turned(-0.3) - READY
    # Wound up by a turn, as a plan may be that came from elsewhere: its end is no reference for the postures left.
    before = Plan(Outcome.OK, np.stack([start, nearest + np.array([0, 0, 0, 0, 0, 2 * np.pi])]))
    fresh, after = (Planner(model, PATIENT).plan(start, LEFT, previous=past) for past in (None, before))
    assert after.how == fresh.how
    assert np.array_equal(assert_good(after, model, start), fresh.path)


def test_what_is_in_collision_is_named(ur5: Kinematics, post_scene: CollisionModel) -> None:
    planner = Planner(post_scene)
    inside = inverse_kinematics(ur5, IN_THE_POST).q_rad
    from_there = planner.plan(inside, READY)
    assert from_there.outcome is Outcome.START_IN_COLLISION
    assert from_there.reason.endswith("_link touches post")
    folded = planner.plan(FOLDED, READY)
    assert folded.outcome is Outcome.START_IN_COLLISION
    assert "shoulder_link touches forearm_link" in folded.reason
    for goal in (inside, IN_THE_POST):
        there = planner.plan(READY, goal)
        assert there.outcome is Outcome.GOAL_IN_COLLISION
        assert there.reason.endswith("_link touches post")
        assert there.path is None


def test_what_is_outside_the_limits_is_named(ur5: Kinematics) -> None:
    planner = Planner(CollisionModel(ur5))
    far = READY.copy()
    far[2] = 3.5
    start, goal = planner.plan(far, READY), planner.plan(READY, far)
    assert start.outcome is Outcome.START_OUTSIDE_LIMITS
    assert goal.outcome is Outcome.GOAL_OUTSIDE_LIMITS
    assert "elbow_joint is at 3.5 rad" in goal.reason


def test_an_unreachable_pose_is_a_result(arm: Kinematics) -> None:
    plan = Planner(CollisionModel(arm)).plan(arm.home_q_rad, tool_down(3.0, 0.0, 0.3))
    assert plan.outcome is Outcome.UNREACHABLE
    assert plan.path is None
    assert "3.0" in plan.reason


def test_where_it_is_already_there_is_nothing_to_do(ur5: Kinematics) -> None:
    plan = Planner(CollisionModel(ur5)).plan(READY, READY)
    assert plan.outcome is Outcome.ALREADY_THERE
    assert plan.length_rad == 0.0


def radial_wall(name: str, angle_rad: float) -> Obstacle:
    """From 0.12 m beside the base's axis outwards, taller than a UR5 reaches: no upper arm is turned past it."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    T = at(0.76 * c, 0.76 * s, 0.8)
    T[:2, :2] = [[c, -s], [s, c]]
    return box(name, (1.28, 0.02, 1.6), T)


def test_a_search_gives_up_in_time(ur5: Kinematics) -> None:
    """Two walls part the room, with the start on one side and the goal on the other; around one wall there is a way."""
    goal = turned(np.pi)
    walls = [radial_wall("one", 3.1), radial_wall("other", 6.2)]
    plan = Planner(CollisionModel(ur5, walls), PlannerCfg(time_limit_s=0.3)).plan(READY, goal, mode="rrt_connect")
    assert plan.outcome is Outcome.TIMED_OUT
    assert plan.path is None
    assert "0.3 s" in plan.reason
    assert plan.seconds >= 0.3
    model = CollisionModel(ur5, walls[1:])
    assert_good(Planner(model, PATIENT).plan(READY, goal, mode="rrt_connect"), model, READY)


def test_a_search_of_so_many_rounds_ends_the_same_way_on_any_machine(post_scene: CollisionModel) -> None:
    """One round grows one branch of 0.6 rad: too little for the way around the post; many rounds are enough."""
    start = left_of_the_post(post_scene)
    goal = inverse_kinematics(post_scene.kinematics, RIGHT, start).q_rad
    few = Planner(post_scene, replace(PATIENT, rounds_n=1)).plan(start, goal, mode="rrt_connect")
    assert few.outcome is Outcome.TIMED_OUT
    assert few.path is None
    assert "1 rounds" in few.reason
    many, free = (Planner(post_scene, cfg).plan(start, goal, mode="rrt_connect") for cfg in (ROUNDS, PATIENT))
    assert np.array_equal(many.path, free.path)


@pytest.mark.parametrize("calls", [1, 3])
def test_a_search_can_be_cancelled(post_scene: CollisionModel, calls: int) -> None:
    start = left_of_the_post(post_scene)
    goal = inverse_kinematics(post_scene.kinematics, RIGHT, start).q_rad
    asked = 0

    def cancel() -> bool:
        nonlocal asked
        asked += 1
        return asked >= calls

    plan = Planner(post_scene, PATIENT).plan(start, goal, mode="rrt_connect", cancel=cancel)
    assert plan.outcome is Outcome.CANCELLED
    assert plan.path is None


def test_a_line_through_another_posture_is_a_jump(ur5: Kinematics) -> None:
    """Straight over the base no UR5 can follow with one posture."""
    start = inverse_kinematics(ur5, tool_down(0.45, 0.0, 0.3), READY).q_rad
    plan = Planner(CollisionModel(ur5)).plan(start, tool_down(-0.45, 0.0, 0.3), mode="cartesian")
    assert plan.outcome is Outcome.JUMP
    assert plan.path is None
    assert re.search(r"between poses \d+ and \d+ of 90", plan.reason)


def test_a_moving_obstacle_is_where_it_is_at_that_time(ur5: Kinematics) -> None:
    goal = turned(-1.2)
    x, y, z = ur5.pose((READY + goal) / 2)[:3, 3]
    passing = box("passing", (0.2, 0.2, 0.2), np.eye(4), motion=lambda t: np.array([at(x, y, z + s) for s in t]))
    planner = Planner(CollisionModel(ur5, [passing]))
    assert planner.plan(READY, goal, mode="joint", time_s=0.0).outcome is Outcome.BLOCKED
    assert planner.plan(READY, goal, mode="joint", time_s=2.0).outcome is Outcome.OK


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda p: p.plan(np.full(6, np.nan), READY), "start_q must be finite"),
        (lambda p: p.plan(READY, np.full(6, np.nan)), "goal must be finite"),
        (lambda p: p.plan(np.zeros(7), READY), "start_q must hold one number for each of the 6 joints"),
        (lambda p: p.plan(READY, np.zeros(5)), "goal must hold one number for each of the 6 joints"),
        (lambda p: p.plan(READY, np.zeros((2, 3))), r"6 joints or one pose \(4, 4\)"),
        (lambda p: p.plan(READY, np.zeros((4, 4))), "goal must hold rotations"),
        (lambda p: p.plan(READY, READY, mode="cartesan"), "did you mean 'cartesian'"),
    ],
)
def test_a_caller_s_mistake_raises(ur5: Kinematics, call: Callable[[Planner], Plan], words: str) -> None:
    with pytest.raises(MotionError, match=words):
        call(Planner(CollisionModel(ur5)))


@pytest.mark.parametrize(
    "field", ["time_limit_s", "resolution_rad", "range_rad", "jump_rad", "shortcuts_n", "rounds_n"]
)
def test_settings_must_be_positive(field: str) -> None:
    with pytest.raises(MotionError, match=rf"planner\.{field} must be positive"):
        PlannerCfg(**{field: 0})
