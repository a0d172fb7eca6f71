import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from tr_grasp.robots.cartesian import FingerDrive, ToolLimits, ToolTarget, inverse_kinematics, next_target, pose_of

LIMITS = ToolLimits(np.array([0.4, -0.1, 0.01]), np.array([0.6, 0.1, 0.25]), yaw_rad=1.5)
unit = st.floats(-1, 1)


class Gantry:
    """A robot whose joints are x, y, z and three small turns about them: kinematics worked by hand."""

    def pose(self, q):
        T = np.eye(4)
        for axis, angle in enumerate(q[3:]):
            c, s = np.cos(angle), np.sin(angle)
            i, j = (axis + 1) % 3, (axis + 2) % 3
            R = np.eye(3)
            R[i, i], R[i, j], R[j, i], R[j, j] = c, -s, s, c
            T[:3, :3] = T[:3, :3] @ R
        T[:3, 3] = q[:3]
        return T

    def jacobian(self, q, step=1e-6):
        T = self.pose(q)
        columns = []
        for k in range(6):
            moved = self.pose(q + step * np.eye(6)[k])
            dR = T[:3, :3].T @ moved[:3, :3]
            turn = np.array([dR[2, 1], dR[0, 2], dR[1, 0]])
            columns.append(np.concatenate([T[:3, :3].T @ (moved[:3, 3] - T[:3, 3]), turn]) / step)
        return np.stack(columns, axis=1)


@given(target=st.tuples(*[st.floats(-0.3, 0.3)] * 6).map(np.array))
def test_inverse_kinematics_finds_a_pose_that_the_arm_can_take(target):
    arm = Gantry()
    q = inverse_kinematics(arm, arm.pose(target), np.zeros(6), np.full(6, -1.0), np.full(6, 1.0), iterations=30)
    np.testing.assert_allclose(arm.pose(q), arm.pose(target), atol=1e-4)


def test_inverse_kinematics_stops_at_the_joint_limits():
    arm = Gantry()
    goal = arm.pose(np.array([2.0, 0, 0, 0, 0, 0]))
    q = inverse_kinematics(arm, goal, np.zeros(6), np.full(6, -1.0), np.full(6, 1.0), iterations=30)
    np.testing.assert_allclose(q, [1, 0, 0, 0, 0, 0], atol=1e-3)


@given(step=st.tuples(unit, unit, unit).map(np.array), turn=st.floats(-9, 9))
def test_a_target_never_leaves_the_limits(step, turn):
    start = ToolTarget(np.array([0.5, 0.0, 0.1]), 0.0)
    target = next_target(start, start.position, step, turn, LIMITS)
    assert (target.position >= LIMITS.lower_m).all()
    assert (target.position <= LIMITS.upper_m).all()
    assert abs(target.yaw_rad) <= LIMITS.yaw_rad


def test_steps_add_to_the_command_unless_contact_holds_the_tool_back():
    commanded = ToolTarget(np.array([0.5, 0.0, 0.10]), 0.0)
    step = np.array([0.0, 0.0, -0.02])
    near, far = np.array([0.5, 0.0, 0.103]), np.array([0.5, 0.0, 0.12])
    np.testing.assert_allclose(next_target(commanded, near, step, 0.1, LIMITS).position[2], 0.08)
    np.testing.assert_allclose(next_target(commanded, far, step, 0.1, LIMITS).position[2], 0.10)


def test_a_turned_target_points_down_and_closes_along_the_turned_axis():
    R = pose_of(ToolTarget(np.zeros(3), np.pi / 2), np.diag([1.0, -1.0, -1.0]))[:3, :3]
    np.testing.assert_allclose(R[:, 2], [0, 0, -1], atol=1e-12)
    np.testing.assert_allclose(R[:, 1], [1, 0, 0], atol=1e-12)


def test_closing_runs_ahead_of_the_fingers_by_the_force_and_no_more():
    drive = FingerDrive(open_m=0.04, speed_mps=0.2, force_n=40.0, stiffness=1000.0)
    setpoint = 0.04
    for _ in range(100):  # something 4 cm wide holds each finger at 2 cm
        setpoint, targets = drive.targets(setpoint, True, np.array([0.02, 0.02]), 0.01)
    np.testing.assert_allclose(1000.0 * (0.02 - targets), [40.0, 40.0])


def test_a_finger_ahead_of_the_other_is_driven_back():
    _, targets = FingerDrive().targets(0.02, True, np.array([0.025, 0.015]), 0.01)
    force = targets - np.array([0.025, 0.015])
    assert force[0] < force[1]


def test_opening_takes_the_time_that_the_speed_says():
    drive, setpoint = FingerDrive(open_m=0.04, speed_mps=0.2), 0.0
    for _ in range(10):
        setpoint, _ = drive.targets(setpoint, False, np.array([setpoint, setpoint]), 0.01)
    np.testing.assert_allclose(setpoint, 0.02)
