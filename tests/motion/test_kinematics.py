from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from tests.motion.conftest import kinematics_of, postures
from tr_grasp.errors import MotionError
from tr_grasp.motion import Kinematics

PI_2 = np.pi / 2


def rotation(axis: int, angle: float) -> np.ndarray:
    T, (i, j) = np.eye(4), ((1, 2), (2, 0), (0, 1))[axis]
    T[[i, j], [i, j]] = np.cos(angle)
    T[i, j], T[j, i] = -np.sin(angle), np.sin(angle)
    return T


def shift(axis: int, way: float) -> np.ndarray:
    T = np.eye(4)
    T[axis, 3] = way
    return T


def test_the_ur5_is_the_published_one() -> None:
    """Universal Robots, DH parameters of the UR5 (CB3): a, d, alpha; the URDF's base is turned by half a turn."""
    table = [
        (0, 0.089159, PI_2),
        (-0.425, 0, 0),
        (-0.39225, 0, 0),
        (0, 0.10915, PI_2),
        (0, 0.09465, -PI_2),
        (0, 0.0823, 0),
    ]
    arm = kinematics_of("ur5_rg2")
    for q in postures(arm, 20):
        T = rotation(2, np.pi)
        for angle, (a, d, alpha) in zip(q, table, strict=True):
            T = T @ rotation(2, angle) @ shift(2, d) @ shift(0, a) @ rotation(0, alpha)
        assert arm.link_pose(q, "tool0") == pytest.approx(T, abs=1e-9)


def test_the_ur5_stretched_out_reaches_what_its_lengths_add_up_to() -> None:
    flange = kinematics_of("ur5_rg2").link_pose(np.zeros(6), "tool0")[:3, 3]
    assert flange == pytest.approx([0.425 + 0.39225, 0.10915 + 0.0823, 0.089159 - 0.09465])


def test_the_panda_is_the_published_one() -> None:
    """Franka, DH parameters in Craig's convention: a, d, alpha before each joint, and the flange."""
    table = [
        (0, 0.333, 0),
        (0, 0, -PI_2),
        (0, 0.316, PI_2),
        (0.0825, 0, PI_2),
        (-0.0825, 0.384, -PI_2),
        (0, 0, PI_2),
        (0.088, 0, PI_2),
    ]
    arm = kinematics_of("panda")
    for q in postures(arm, 20):
        T = np.eye(4)
        for angle, (a, d, alpha) in zip(q, table, strict=True):
            T = T @ rotation(0, alpha) @ shift(0, a) @ rotation(2, angle) @ shift(2, d)
        assert arm.link_pose(q, "panda_link8") == pytest.approx(T @ shift(2, 0.107), abs=1e-6)


def test_the_kinova_is_the_published_one() -> None:
    """Kinova, classic DH parameters of the 7-joint spherical arm: alpha, a, d; joint angles from the vertical."""
    table = [
        (PI_2, 0, -0.2755),
        (PI_2, 0, 0),
        (PI_2, 0, -0.410),
        (PI_2, 0, -0.0098),
        (PI_2, 0, -0.3111),
        (PI_2, 0, 0),
        (np.pi, 0, -0.2638),
    ]
    arm = kinematics_of("j2s7s300")
    offsets = np.array([np.pi, 0, 0, 0, 0, 0, PI_2])
    wrists = []
    for q in postures(arm, 20):
        T = rotation(0, np.pi)
        for angle, (alpha, a, d) in zip(q + offsets, table, strict=True):
            T = T @ rotation(2, angle) @ shift(2, d) @ shift(0, a) @ rotation(0, alpha)
        wrists.append(np.linalg.norm(arm.link_pose(q, "j2s7s300_end_effector")[:3, 3] - T[:3, 3]))
    # The published table rounds, and lumps the two offsets of shoulder and elbow (1.6 and 11.4 mm) into one of 9.8 mm.
    assert max(wrists) < 4e-3


def test_a_batch_is_pinocchio_one_by_one(arm: Kinematics) -> None:
    data, frame = arm.model.createData(), arm.model.getFrameId(arm.spec.tcp_link)
    q = postures(arm, 10)
    T, J = arm.pose(q), arm.jacobian(q)
    for i in range(10):
        pin.forwardKinematics(arm.model, data, q[i])
        pin.updateFramePlacements(arm.model, data)
        base = data.oMf[arm.model.getFrameId(arm.spec.base_link)]
        assert T[i] == pytest.approx((base.inverse() * data.oMf[frame]).homogeneous, abs=1e-12)
        expected = pin.computeFrameJacobian(arm.model, data, q[i], frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        assert J[i] == pytest.approx(np.kron(np.eye(2), base.rotation.T) @ expected, abs=1e-12)


def test_the_velocity_of_the_tool_is_its_difference_in_time(arm: Kinematics) -> None:
    q, dq = postures(arm, 2, seed=3)
    h = 1e-6
    before, after = arm.pose(q - h * dq), arm.pose(q + h * dq)
    velocity = arm.tcp_velocity(q, dq)
    assert velocity[:3] == pytest.approx((after - before)[:3, 3] / (2 * h), abs=1e-6)
    turn = pin.log3(after[:3, :3] @ before[:3, :3].T) / (2 * h)
    assert velocity[3:] == pytest.approx(turn, abs=1e-6)


def test_shapes_follow_the_batch(arm: Kinematics) -> None:
    q = postures(arm, 6).reshape(2, 3, arm.dof)
    assert arm.pose(q).shape == (2, 3, 4, 4)
    assert arm.jacobian(q).shape == (2, 3, 6, arm.dof)
    assert arm.manipulability(q).shape == (2, 3)
    assert arm.limit_distance_rad(q).shape == (2, 3)


def test_a_straight_arm_is_singular(ur5: Kinematics) -> None:
    assert ur5.manipulability(np.zeros(6)) == pytest.approx(0.0, abs=1e-9)
    assert ur5.manipulability([0.0, -1.2, 1.6, -1.9, -1.57, 0.0]) > 0.05


def test_manipulability_is_the_product_of_the_singular_values(arm: Kinematics) -> None:
    q = postures(arm, 5)
    values = np.linalg.svd(arm.jacobian(q), compute_uv=False)
    assert arm.manipulability(q) == pytest.approx(values.prod(-1), rel=1e-6, abs=1e-12)


def test_the_distance_to_a_limit_is_that_of_the_nearest_joint(panda: Kinematics) -> None:
    q = (panda.lower_rad + panda.upper_rad) / 2
    q[4] = panda.upper_rad[4] - 0.1
    assert panda.limit_distance_rad(q) == pytest.approx(0.1)
    q[2] = panda.lower_rad[2] - 0.2
    assert panda.limit_distance_rad(q) == pytest.approx(-0.2)


def test_the_stick_figure_goes_from_the_base_to_the_tool(arm: Kinematics) -> None:
    q = postures(arm, 1)[0]
    points = arm.joint_positions(q)
    assert points.shape == (arm.dof + 2, 3)
    assert not points[0].any()
    assert points[-1] == pytest.approx(arm.pose(q)[:3, 3])


@pytest.mark.parametrize("q", [np.zeros(5), np.full(6, np.nan), 0.0])
def test_other_joints_are_refused(ur5: Kinematics, q) -> None:
    with pytest.raises(MotionError, match="q must"):
        ur5.pose(q)


def test_an_unknown_link_gets_the_valid_ones(ur5: Kinematics) -> None:
    with pytest.raises(MotionError, match="did you mean 'tool0'"):
        ur5.link_pose(np.zeros(6), "tool00")
