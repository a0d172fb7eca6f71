import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from tr_grasp.configs import ActionCfg
from tr_grasp.envs.expert import CLOSE, OPEN, ToolState, choose_grasp, expert_action, lift_action, target_from_tool
from tr_grasp.grasps import Grasp, TopDownGrasps

ACTION, OPENING_M = ActionCfg(), 0.08
TARGET = np.array([0.5, 0.0, 0.03])
CENTRE_M = np.array([0.5, 0.0])


def tool(position, yaw=0.0, closing=False, opening=OPENING_M, speed=0.0) -> ToolState:
    return ToolState(np.array(position, float), yaw, closing, False, opening, speed)


def fly(position, yaw, target_yaw, width=0.05, depth=0.03, steps=40):
    """Follow the expert with perfect motion; the poses on the way and the last action."""
    position, path = np.array(position, float), []
    for _ in range(steps):
        action = expert_action(tool(position, yaw), Grasp(TARGET, target_yaw, width, depth), ACTION, OPENING_M)
        path.append((position.copy(), yaw))
        if action[4] == CLOSE:
            return path, action
        position = position + action[:3] * ACTION.translation_step_m
        yaw += action[3] * ACTION.yaw_step_rad
    return path, action


@given(
    x=st.floats(0.38, 0.62),
    y=st.floats(-0.12, 0.12),
    z=st.floats(0.02, 0.25),
    yaw=st.floats(-1.8, 1.8),
    goal=st.floats(0, 3.1),
)
def test_from_anywhere_the_expert_closes_at_the_grasp_within_ten_seconds(x, y, z, yaw, goal):
    path, action = fly([x, y, z], yaw, goal)
    assert action[4] == CLOSE
    position, final_yaw = path[-1]
    assert np.linalg.norm(position - TARGET) < 0.02
    assert abs(np.sin(final_yaw - goal)) < np.sin(0.36)


@given(x=st.floats(0.38, 0.62), y=st.floats(-0.12, 0.12))
def test_the_tool_comes_down_only_where_it_is_above_the_grasp(x, y):
    for position, _ in fly([x, y, 0.2], 0.0, 0.0)[0]:
        sideways = np.linalg.norm(position[:2] - TARGET[:2])
        assert position[2] >= TARGET[2] + min(0.08, 1.6 * (sideways - 0.012)) - 1e-6


def test_over_a_thin_object_the_tool_comes_lower_before_it_closes():
    above = tool(TARGET + np.array([0, 0, 0.006]))
    thin, thick = (expert_action(above, Grasp(TARGET, 0.0, 0.011, depth), ACTION, OPENING_M) for depth in (0.008, 0.03))
    assert thin[4] == OPEN
    assert thin[2] < 0
    assert thick[4] == CLOSE


def test_shut_fingers_rise_as_with_a_rim_between_them_and_open_only_where_the_camera_sees_them():
    grasp = Grasp(TARGET, 0.0, 0.05, 0.03)
    low, high = (
        expert_action(tool(TARGET + np.array([0, 0, up]), closing=True, opening=0.0), grasp, ACTION, OPENING_M)
        for up in (0.0, 0.09)
    )
    np.testing.assert_array_equal(low, lift_action())
    assert high[4] == OPEN
    assert high[2] > 0


def test_fingers_that_are_still_closing_are_not_opened_because_the_object_was_pushed():
    beside = TARGET + np.array([0.03, 0, 0])
    closing, stuck = (
        expert_action(tool(beside, closing=True, opening=0.06, speed=v), Grasp(TARGET, 0.0, 0.05, 0.03), ACTION, 0.11)
        for v in (-0.1, 0.0)
    )
    np.testing.assert_array_equal(closing, [0, 0, 0, 0, CLOSE])
    assert stuck[4] == OPEN


def test_the_tool_stays_above_the_grasp_until_the_fingers_are_half_open():
    above = TARGET + np.array([0, 0, 0.05])
    grasp = Grasp(TARGET, 0.0, 0.03, 0.03)
    narrow, wide = (expert_action(tool(above, opening=opening), grasp, ACTION, 0.11)[2] for opening in (0.05, 0.06))
    assert narrow == 0
    assert wide < 0


def test_a_wider_gripper_may_close_farther_beside_the_grasp():
    beside = tool(TARGET + np.array([0.011, 0, 0]))
    grasp = Grasp(TARGET, 0.0, 0.066, 0.03)
    assert expert_action(beside, grasp, ACTION, 0.08)[4] == OPEN
    assert expert_action(beside, grasp, ACTION, 0.11)[4] == CLOSE


def grasps_at(xy, yaw, score=1.0) -> TopDownGrasps:
    position = np.column_stack([xy, np.full(len(xy), 0.03)])
    sizes = np.full((2, len(xy)), 0.04)
    return TopDownGrasps(position, np.asarray(yaw, float), *sizes, np.full(len(xy), score), np.arange(len(xy)))


def test_the_nearer_of_two_grasps_as_far_from_the_centre_is_chosen():
    two = grasps_at([[0.4, 0], [0.6, 0]], [0, 0])
    assert choose_grasp(two, tool([0.45, 0, 0.2]), CENTRE_M) == 0
    assert choose_grasp(two, tool([0.55, 0, 0.2]), CENTRE_M) == 1


def test_over_the_middle_of_a_book_the_corner_nearest_the_centre_is_chosen_and_kept_on_the_way():
    middle, arms = np.array([0.56, 0.03]), np.array([[0.05, 0.01], [0.01, -0.05], [-0.05, -0.01], [-0.01, 0.05]])
    corners = grasps_at(middle + arms, np.zeros(4))
    wanted = 2  # 14 mm from the centre along x and 20 mm along y
    assert np.argmin(np.linalg.norm(corners.position[:, :2] - CENTRE_M, axis=1)) == wanted
    for share in np.linspace(-0.5, 1, 16):
        assert choose_grasp(corners, tool([*(middle + share * arms[wanted]), 0.2]), CENTRE_M) == wanted


@given(
    quarters=st.integers(0, 3),
    mirrored=st.booleans(),
    xy=arrays(float, (5, 2), elements=st.floats(-0.125, 0.125, width=16)),
    yaws=arrays(float, 5, elements=st.floats(0, 3, width=16)),
    place=arrays(float, 2, elements=st.floats(-0.125, 0.125, width=16)),
)
def test_turned_and_mirrored_scenes_get_the_same_choice(quarters, mirrored, xy, yaws, place):
    choices = []
    for turn in (np.eye(2), np.linalg.matrix_power([[0, -1], [1, 0]], quarters) @ np.diag([1, -1 if mirrored else 1])):
        directions = turn @ np.stack([np.cos(yaws), np.sin(yaws)])
        grasps = grasps_at(CENTRE_M + xy @ turn.T, np.arctan2(directions[1], directions[0]) % np.pi)
        closing = turn @ [1, 0]
        hand = tool([*(CENTRE_M + turn @ place), 0.2], yaw=np.arctan2(closing[1], closing[0]))
        choices.append(choose_grasp(grasps, hand, CENTRE_M))
    first, second = choices
    assert first == second or are_worth_the_same(xy, yaws, place, first, second)


def are_worth_the_same(xy, yaws, place, i, j):
    """Ties, which rounding may decide either way."""
    turn = np.abs((yaws + np.pi / 2) % np.pi - np.pi / 2)
    cost = np.linalg.norm(xy - place, axis=1) / 0.15 + 0.25 * turn + np.linalg.norm(xy, axis=1) / 0.2
    return np.isclose(cost[i], cost[j])


def test_without_a_grasp_there_is_no_choice():
    none = TopDownGrasps(np.zeros((0, 3)), *np.zeros((4, 0)), np.zeros(0, int))
    assert choose_grasp(none, tool([0.5, 0, 0.2]), CENTRE_M) is None


def test_the_target_says_where_the_grasp_is_and_how_far_to_turn():
    target = target_from_tool(
        tool([0.5, 0.0, 0.2], yaw=0.1), Grasp(np.array([0.52, -0.01, 0.05]), 0.1 + np.pi / 4, 0.05, 0.03)
    )
    np.testing.assert_allclose(target, [0.02, -0.01, -0.15, 0.0, 1.0, 1.0], atol=1e-6)


@given(yaw=st.floats(-3, 3), goal=st.floats(0, 3.1))
def test_half_a_turn_of_the_gripper_changes_no_target(yaw, goal):
    near, far = (
        target_from_tool(tool([0.5, 0, 0.2], yaw=y), Grasp(TARGET, goal, 0.05, 0.03)) for y in (yaw, yaw + np.pi)
    )
    np.testing.assert_allclose(near, far, atol=1e-5)
