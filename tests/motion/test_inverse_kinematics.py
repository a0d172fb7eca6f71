from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.motion.conftest import kinematics_of, postures, tool_down
from tr_grasp.errors import MotionError
from tr_grasp.motion import IKCfg, Kinematics, Outcome, inverse_kinematics, tool_target
from tr_grasp.motion.joint_turns import nearest_turn


def assert_reached(arm: Kinematics, q: np.ndarray, T: np.ndarray) -> None:
    reached = arm.pose(q)
    assert np.abs(reached[..., :3, 3] - T[..., :3, 3]).max() < 2e-5
    assert np.abs(reached[..., :3, :3] - T[..., :3, :3]).max() < 2e-4
    assert arm.limit_distance_rad(q).min() > -1e-9


def test_reachable_poses_are_reached_within_the_limits(arm: Kinematics) -> None:
    T = arm.pose(postures(arm, 200, seed=1))
    solutions = inverse_kinematics(arm, T)
    assert solutions.found.mean() >= 0.99
    assert_reached(arm, solutions.q_rad[solutions.found], T[solutions.found])


def test_all_eight_postures_of_a_ur5_reach_the_pose(ur5: Kinematics) -> None:
    T = tool_down(0.5, 0.1, 0.2)
    found = inverse_kinematics(ur5, T).all_of()
    assert len(found) == 8
    assert_reached(ur5, found, T)
    gaps = np.abs(found[:, None] - found[None]).max(-1) + 10 * np.eye(8)
    assert gaps.min() > 0.1


def test_the_posture_it_came_from_is_among_those_of_a_ur5(ur5: Kinematics) -> None:
    for q in postures(ur5, 30, seed=2):
        found = inverse_kinematics(ur5, ur5.pose(q), q)
        assert found.q_rad == pytest.approx(q, abs=1e-5)


def test_the_nearest_posture_comes_first(arm: Kinematics) -> None:
    reference = arm.home_q_rad
    T = arm.pose(postures(arm, 20, seed=4))
    solutions = inverse_kinematics(arm, T, reference, IKCfg(postures_n=3))
    gaps = np.abs(solutions.postures_rad - reference).max(-1)
    gaps = np.where(np.isnan(gaps), np.inf, gaps)
    assert (gaps[:, :-1] <= gaps[:, 1:]).all()


def test_a_pose_near_the_reference_keeps_the_posture(arm: Kinematics) -> None:
    q = postures(arm, 30, seed=5) * 0.9 + 0.1 * (arm.lower_rad + arm.upper_rad) / 2
    solutions = inverse_kinematics(arm, arm.pose(q), q + 0.02)
    assert solutions.found.all()
    assert np.median(np.abs(solutions.q_rad - q).max(1)) < 0.05


def test_a_batch_is_its_poses_one_by_one(arm: Kinematics) -> None:
    T = arm.pose(postures(arm, 6, seed=6)).reshape(2, 3, 4, 4)
    batch = inverse_kinematics(arm, T, arm.home_q_rad)
    assert batch.q_rad.shape == (2, 3, arm.dof)
    for i in np.ndindex(2, 3):
        alone = inverse_kinematics(arm, T[i], arm.home_q_rad)
        assert alone.found == batch.found[i]
        assert alone.q_rad == pytest.approx(batch.q_rad[i], abs=1e-3, nan_ok=True)


def test_angles_turn_towards_the_reference(ur5: Kinematics) -> None:
    q = np.array([-0.3, 1.2, 1.4, 1.7, -1.5, 0.2])
    turned = q + 2 * np.pi * np.array([1, -1, 0, -1, 1, -1])
    assert inverse_kinematics(ur5, ur5.pose(q), turned + 0.05).q_rad == pytest.approx(turned, abs=1e-6)
    assert inverse_kinematics(ur5, ur5.pose(q), q + 0.05).q_rad == pytest.approx(q, abs=1e-6)


@given(q=st.floats(-12, 12), reference=st.floats(-6, 6))
def test_turns_are_whole_nearest_and_inside(q: float, reference: float) -> None:
    lower, upper = np.array([-6.0]), np.array([6.0])
    turned = nearest_turn(np.array([q]), np.array([reference]), lower, upper)[0]
    copies = q + 2 * np.pi * np.arange(-4, 5)
    allowed = copies[(copies >= -6) & (copies <= 6)]
    best = allowed[np.argmin(np.abs(allowed - reference))]
    assert abs(turned - reference) == pytest.approx(abs(best - reference), abs=1e-6)


def test_no_turn_that_fits_is_no_angle() -> None:
    assert np.isnan(nearest_turn(np.array([2.0]), np.array([0.0]), np.array([-1.0]), np.array([1.0])))[0]


def test_out_of_reach_is_a_reason_and_leaves_the_others_alone(arm: Kinematics) -> None:
    T = np.stack([arm.pose(arm.home_q_rad), tool_down(3.0, 0.0, 0.2)])
    solutions = inverse_kinematics(arm, T)
    assert list(solutions.outcomes) == [Outcome.OK, Outcome.UNREACHABLE]
    assert np.isnan(solutions.q_rad[1]).all()
    assert len(solutions.all_of(1)) == 0
    assert "no joint angles" in solutions.outcomes[1].label


def test_the_answer_is_the_same_every_time(panda: Kinematics) -> None:
    T = panda.pose(postures(panda, 20, seed=7))
    assert np.array_equal(inverse_kinematics(panda, T).q_rad, inverse_kinematics(panda, T).q_rad, equal_nan=True)


@pytest.mark.parametrize(
    "T", [np.zeros((4, 4)), np.full((4, 4), np.nan), np.eye(3), np.diag([1.0, 1.0, -1.0, 1.0]), 2 * np.eye(4)]
)
def test_what_is_no_pose_is_refused(ur5: Kinematics, T: np.ndarray) -> None:
    with pytest.raises(MotionError, match="T_base_tcp must"):
        inverse_kinematics(ur5, T)


def test_a_reference_of_another_arm_is_refused(ur5: Kinematics) -> None:
    with pytest.raises(MotionError, match="reference_q must hold one number for each of the 6 joints"):
        inverse_kinematics(ur5, np.eye(4), np.zeros(7))


def test_a_moving_tool_is_a_moving_joint_target() -> None:
    for name in ("ur5_rg2", "panda"):
        arm = kinematics_of(name)
        velocity = np.array([0.1, -0.05, 0.02, 0.0, 0.0, 0.3])
        target = tool_target(arm, arm.pose(arm.home_q_rad), velocity, arm.home_q_rad)
        assert target is not None
        assert target.q == pytest.approx(arm.home_q_rad, abs=1e-6)
        assert arm.tcp_velocity(target.q, target.dq) == pytest.approx(velocity, abs=1e-3)
        assert tool_target(arm, tool_down(3, 0, 0), velocity, arm.home_q_rad) is None
