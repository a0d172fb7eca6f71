"""Universal Robots UR5 (CB3) with the grippers it is often seen with.

Origins, masses, limits and inertias: Universal Robots' published DH parameters and ``ur_description`` (BSD-3). Its
inertias of the wrists belong to a body a hundred times larger, so those are a solid cylinder's here. Nobody publishes
limits of acceleration and jerk; ours are what the arm's own moves stay under.
"""

from __future__ import annotations

from math import pi

from tr_grasp.robots.linkage import LinkageGripper, rg2, robotiq_2f85
from tr_grasp.robots.parts import DhRow, DhTable, JointSpec, LinkSpec, Vector
from tr_grasp.robots.solids import ball, rod, rod_inertia, tube
from tr_grasp.robots.spec import RobotSpec

ALUMINIUM: Vector = (0.76, 0.78, 0.80)
CAP_BLUE: Vector = (0.36, 0.62, 0.80)
DARK: Vector = (0.22, 0.23, 0.25)

UR5_DH = DhTable(
    rows=(
        DhRow(0.0, 0.089159, pi / 2),
        DhRow(-0.425, 0.0, 0.0),
        DhRow(-0.39225, 0.0, 0.0),
        DhRow(0.0, 0.10915, pi / 2),
        DhRow(0.0, 0.09465, -pi / 2),
        DhRow(0.0, 0.0823, 0.0),
    ),
    link="tool0",
    base_rpy_rad=(0.0, 0.0, pi),
    source="Universal Robots, DH parameters for calculations of kinematics and dynamics, UR5",
)


def ur5_rg2() -> RobotSpec:
    """UR5 with an OnRobot RG2."""
    home = (-0.220072, -1.565889, 1.638887, -1.643794, -1.570796, -1.790868)
    return _with_gripper("ur5_rg2", rg2("tool0"), home)


def ur5_robotiq_2f85() -> RobotSpec:
    """UR5 with a Robotiq 2F-85."""
    home = (-0.220072, -1.560127, 1.693691, -1.70436, -1.570796, -1.790868)
    return _with_gripper("ur5_robotiq_2f85", robotiq_2f85("tool0"), home)


def _with_gripper(name: str, gripper: LinkageGripper, home: tuple[float, ...]) -> RobotSpec:
    flange = JointSpec("tool0_joint", "wrist_3_link", "tool0", "fixed", (0.0, 0.0823, 0.0), (-pi / 2, 0.0, 0.0))
    return RobotSpec(
        name=name,
        base_link="base_link",
        tcp_link="tcp",
        joints=_joints(),
        gripper=gripper.spec,
        home_q_rad=home,
        links=(*_links(), *gripper.links),
        fixed_joints=(flange, *gripper.fixed_joints),
        dh=UR5_DH,
    )


def _joints() -> tuple[JointSpec, ...]:
    y, z = (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    quarter = (0.0, pi / 2, 0.0)
    level = (0.0, 0.0, 0.0)
    rows = [
        ("shoulder_pan", "base", "shoulder", (0.0, 0.0, 0.089159), level, z, 2 * pi, 150.0, 3.15),
        ("shoulder_lift", "shoulder", "upper_arm", (0.0, 0.13585, 0.0), quarter, y, 2 * pi, 150.0, 3.15),
        ("elbow", "upper_arm", "forearm", (0.0, -0.1197, 0.425), level, y, pi, 150.0, 3.15),
        ("wrist_1", "forearm", "wrist_1", (0.0, 0.0, 0.39225), quarter, y, 2 * pi, 28.0, 3.2),
        ("wrist_2", "wrist_1", "wrist_2", (0.0, 0.093, 0.0), level, z, 2 * pi, 28.0, 3.2),
        ("wrist_3", "wrist_2", "wrist_3", (0.0, 0.0, 0.09465), level, y, 2 * pi, 28.0, 3.2),
    ]
    return tuple(
        JointSpec(
            f"{name}_joint",
            f"{parent}_link",
            f"{child}_link",
            "revolute",
            xyz,
            rpy,
            axis,
            lower=-turn,
            upper=turn,
            velocity=velocity,
            acceleration=8.0,
            jerk=80.0,
            effort=effort,
        )
        for name, parent, child, xyz, rpy, axis, turn, effort, velocity in rows
    )


def _links() -> tuple[LinkSpec, ...]:
    wrist = rod_inertia(1.219, 0.04, 0.13)
    return (
        LinkSpec("base_link", 4.0, (0.0, 0.0, 0.04), (0.00443, 0.00443, 0.0072, 0.0, 0.0, 0.0), _base()),
        LinkSpec("shoulder_link", 3.7, (0.0, 0.0, 0.0), (0.010267, 0.010267, 0.00666, 0.0, 0.0, 0.0), _shoulder()),
        LinkSpec("upper_arm_link", 8.393, (0.0, 0.0, 0.28), (0.22689, 0.22689, 0.0151074, 0.0, 0.0, 0.0), _upper_arm()),
        LinkSpec("forearm_link", 2.275, (0.0, 0.0, 0.25), (0.049443, 0.049443, 0.004095, 0.0, 0.0, 0.0), _forearm()),
        LinkSpec("wrist_1_link", 1.219, (0.0, 0.08, 0.0), wrist, _wrist_1()),
        LinkSpec("wrist_2_link", 1.219, (0.0, 0.0, 0.08), wrist, _wrist_2()),
        LinkSpec("wrist_3_link", 0.1879, (0.0, 0.06, 0.0), rod_inertia(0.1879, 0.0375, 0.04, "y"), _wrist_3()),
        LinkSpec("tool0"),
    )


def _base():
    return (
        rod((0, 0, 0), (0, 0, 0.022), 0.0755, DARK),
        rod((0, 0, 0.022), (0, 0, 0.038), 0.068, ALUMINIUM, collides=False),
    )


def _shoulder():
    return (
        rod((0, 0, -0.051), (0, 0, 0.045), 0.060, ALUMINIUM),
        rod((0, 0, 0.045), (0, 0, 0.058), 0.056, CAP_BLUE, collides=False),
        rod((0, 0, 0), (0, 0.071, 0), 0.056, ALUMINIUM),
        rod((0, 0.071, 0), (0, 0.0745, 0), 0.053, DARK, collides=False),
    )


def _upper_arm():
    return (
        rod((0, -0.061, 0), (0, 0.052, 0), 0.058, ALUMINIUM),
        rod((0, 0.052, 0), (0, 0.066, 0), 0.054, CAP_BLUE, collides=False),
        *tube((0, 0, 0.05), (0, 0, 0.375), (0.053, 0.045), ALUMINIUM),
        rod((0, -0.058, 0.425), (0, 0.047, 0.425), 0.051, ALUMINIUM),
        rod((0, 0.047, 0.425), (0, 0.060, 0.425), 0.047, CAP_BLUE, collides=False),
        rod((0, -0.061, 0.425), (0, -0.058, 0.425), 0.048, DARK, collides=False),
    )


def _forearm():
    return (
        rod((0, -0.046, 0), (0, 0.058, 0), 0.051, ALUMINIUM),
        rod((0, -0.060, 0), (0, -0.046, 0), 0.047, CAP_BLUE, collides=False),
        *tube((0, 0, 0.045), (0, 0, 0.355), (0.045, 0.037), ALUMINIUM),
        rod((0, -0.040, 0.39225), (0, 0.044, 0.39225), 0.0375, ALUMINIUM),
        rod((0, -0.051, 0.39225), (0, -0.040, 0.39225), 0.034, CAP_BLUE, collides=False),
    )


def _wrist_1():
    return (
        rod((0, 0.046, 0), (0, 0.093, 0), 0.0365, ALUMINIUM),
        rod((0, 0.093, -0.042), (0, 0.093, 0.046), 0.0375, ALUMINIUM),
        rod((0, 0.093, -0.053), (0, 0.093, -0.042), 0.034, CAP_BLUE, collides=False),
        rod((0, 0.044, 0), (0, 0.046, 0), 0.034, DARK, collides=False),
    )


def _wrist_2():
    return (
        rod((0, 0, 0.048), (0, 0, 0.09465), 0.0365, ALUMINIUM),
        rod((0, -0.042, 0.09465), (0, 0.044, 0.09465), 0.0375, ALUMINIUM),
        rod((0, -0.053, 0.09465), (0, -0.042, 0.09465), 0.034, CAP_BLUE, collides=False),
        rod((0, 0, 0.046), (0, 0, 0.048), 0.034, DARK, collides=False),
    )


def _wrist_3():
    return (
        rod((0, 0.047, 0), (0, 0.0823, 0), 0.0365, ALUMINIUM),
        rod((0, 0.044, 0), (0, 0.047, 0), 0.034, DARK, collides=False),
        ball((0, 0.0645, 0.0365), 0.004, CAP_BLUE),
    )
