"""Kinova Jaco, seven joints, spherical wrist, three fingers (j2s7s300).

Origins, masses and centres of mass: Kinova's ``j2s7s300.xacro`` and ``kinova_inertial.xacro`` (BSD-3), speeds and
limits: its user guide. The guide's DH table rounds the wrist and leaves out the shoulder's 1.6 mm; ours has them.
Limits of acceleration and jerk are ours: Kinova publishes none.
"""

from __future__ import annotations

from math import pi, radians

from tr_grasp.robots.kg3 import CARBON, FINGER_BASES, PREFIX, SILVER, TCP_BEYOND_LINK_7_M, kg3_fingers, kg3_gripper
from tr_grasp.robots.parts import DhRow, DhTable, JointSpec, LinkSpec, Vector
from tr_grasp.robots.solids import ball, block, rod, rod_inertia, tube
from tr_grasp.robots.spec import RobotSpec

RING: Vector = (0.55, 0.57, 0.60)

J2S7S300_DH = DhTable(
    rows=(
        DhRow(0.0, -0.2755, pi / 2, offset_rad=pi),
        DhRow(0.0, -0.0016, pi / 2),
        DhRow(0.0, -0.41, pi / 2),
        DhRow(0.0, -0.0114, pi / 2),
        DhRow(0.0, -(0.2073 + 0.10375), pi / 2),
        DhRow(0.0, 0.0, pi / 2),
        DhRow(0.0, -(0.10375 + 0.16), pi, offset_rad=-pi / 2),
    ),
    link=f"{PREFIX}end_effector",
    base_rpy_rad=(pi, 0.0, 0.0),
    source="Kinova, DH parameters of the j2s7s300 with lengths of kinova_description",
)


def j2s7s300() -> RobotSpec:
    """Kinova j2s7s300 with the KG-3 hand.

    The hand's fingers are simplified; see :mod:`tr_grasp.robots.kg3`.
    """
    hand = f"{PREFIX}link_7"
    fingers, finger_links = kg3_fingers(hand)
    ends = (
        JointSpec(
            f"{PREFIX}end_effector_offset", hand, f"{PREFIX}end_effector", "fixed", (0.0, 0.0, -0.16), (pi, 0.0, pi / 2)
        ),
        JointSpec(f"{PREFIX}tcp_joint", hand, "tcp", "fixed", (0.0, 0.0, -TCP_BEYOND_LINK_7_M), (pi, 0.0, 0.0)),
    )
    return RobotSpec(
        name="j2s7s300",
        base_link=f"{PREFIX}link_base",
        tcp_link="tcp",
        joints=_joints(),
        gripper=kg3_gripper(fingers),
        home_q_rad=(0.024095, 2.598798, 3.144696, 1.726606, -3.143324, 1.957778, 0.027406),
        links=(*_links(), *finger_links, LinkSpec(f"{PREFIX}end_effector"), LinkSpec("tcp")),
        fixed_joints=ends,
        dh=J2S7S300_DH,
    )


def _joints() -> tuple[JointSpec, ...]:
    q, slow, fast = pi / 2, radians(36), radians(48)
    rows = [
        ((0.0, 0.0, 0.15675), (0.0, pi, 0.0), None, 40.0, slow),
        ((0.0, 0.0016, -0.11875), (-q, 0.0, pi), (47, 313), 80.0, slow),
        ((0.0, -0.205, 0.0), (-q, 0.0, 0.0), None, 40.0, slow),
        ((0.0, 0.0, -0.205), (q, 0.0, pi), (30, 330), 40.0, slow),
        ((0.0, 0.2073, -0.0114), (-q, 0.0, pi), None, 20.0, fast),
        ((0.0, 0.0, -0.10375), (q, 0.0, pi), (65, 295), 20.0, fast),
        ((0.0, 0.10375, 0.0), (-q, 0.0, pi), None, 20.0, fast),
    ]
    joints = []
    for k, (xyz, rpy, limits_deg, effort, velocity) in enumerate(rows):
        # Joints without a stop get two turns either way: a simulator needs limits to know where it is.
        lower, upper = (radians(limits_deg[0]), radians(limits_deg[1])) if limits_deg else (-2 * pi, 2 * pi)
        parent = f"{PREFIX}link_{k}" if k else f"{PREFIX}link_base"
        joints.append(
            JointSpec(
                f"{PREFIX}joint_{k + 1}", parent, f"{PREFIX}link_{k + 1}", "revolute", xyz, rpy, lower=lower,
                upper=upper, velocity=velocity, acceleration=4.0, jerk=40.0, effort=effort,
            )
        )  # fmt: skip
    return tuple(joints)


def _links() -> tuple[LinkSpec, ...]:
    rows = [
        ("link_base", 0.46784, (0.0, 0.0, 0.1255), rod_inertia(0.46784, 0.04, 0.15), _base()),
        ("link_1", 0.7477, (0.0, -0.002, -0.0605), rod_inertia(0.7477, 0.04, 0.15), _shoulder()),
        ("link_2", 0.8447, (0.0, -0.103563, 0.0), rod_inertia(0.8447, 0.03, 0.18, "y"), _arm_half_1()),
        ("link_3", 0.8447, (0.0, 0.0, -0.102245), rod_inertia(0.8447, 0.03, 0.18), _arm_half_2()),
        ("link_4", 0.6763, (0.0, 0.081, -0.0086), rod_inertia(0.6763, 0.03, 0.2, "y"), _forearm()),
        ("link_5", 0.463, (0.0, 0.0028848, -0.0541932), rod_inertia(0.463, 0.02, 0.1), _wrist_1()),
        ("link_6", 0.463, (0.0, 0.0497208, -0.0028562), rod_inertia(0.463, 0.02, 0.1, "y"), _wrist_2()),
        ("link_7", 0.99, (0.0, 0.0, -0.06), rod_inertia(0.99, 0.04, 0.1), _hand()),
    ]
    return tuple(LinkSpec(PREFIX + name, mass, com, inertia, shapes) for name, mass, com, inertia, shapes in rows)


def _base():
    return (
        rod((0, 0, 0), (0, 0, 0.012), 0.062, SILVER),
        rod((0, 0, 0.012), (0, 0, 0.118), 0.042, CARBON),
        rod((0, 0, 0.118), (0, 0, 0.157), 0.044, SILVER),
    )


def _shoulder():
    return (
        *tube((0, 0, -0.003), (0, 0, -0.080), (0.044, 0.042), CARBON, steps=2),
        rod((0, 0.042, -0.11875), (0, -0.020, -0.11875), 0.043, CARBON),
        ball((0, 0.034, -0.11875), 0.042, CARBON),
        rod((0, -0.020, -0.11875), (0, -0.026, -0.11875), 0.043, RING, collides=False),
    )


def _arm_half_1():
    return (
        rod((0, 0, -0.006), (0, 0, 0.044), 0.043, CARBON),
        ball((0, 0, 0.034), 0.042, CARBON),
        *tube((0, -0.030, 0), (0, -0.176, 0), (0.041, 0.038), CARBON),
        rod((0, -0.176, 0), (0, -0.205, 0), 0.039, SILVER, collides=False),
    )


def _arm_half_2():
    return (
        *tube((0, 0, -0.003), (0, 0, -0.168), (0.038, 0.041), CARBON),
        rod((0, 0.042, -0.205), (0, -0.018, -0.205), 0.042, CARBON),
        ball((0, 0.034, -0.205), 0.041, CARBON),
        rod((0, -0.018, -0.205), (0, -0.023, -0.205), 0.042, RING, collides=False),
    )


def _forearm():
    return (
        rod((0, 0, -0.040), (0, 0, 0.012), 0.041, CARBON),
        ball((0, 0, -0.034), 0.040, CARBON),
        *tube((0, 0.028, -0.0114), (0, 0.182, -0.0114), (0.036, 0.031), CARBON),
        rod((0, 0.182, -0.0114), (0, 0.2073, -0.0114), 0.032, SILVER, collides=False),
    )


def _wrist_1():
    return (
        *tube((0, 0, -0.002), (0, 0, -0.080), (0.031, 0.0315), CARBON, steps=2),
        rod((0, 0.032, -0.10375), (0, -0.014, -0.10375), 0.0325, CARBON),
        ball((0, 0.026, -0.10375), 0.032, CARBON),
        rod((0, -0.014, -0.10375), (0, -0.018, -0.10375), 0.0325, RING, collides=False),
    )


def _wrist_2():
    return (
        rod((0, 0, -0.014), (0, 0, 0.032), 0.0325, CARBON),
        ball((0, 0, 0.026), 0.032, CARBON),
        *tube((0, 0.020, 0), (0, 0.082, 0), (0.031, 0.032), CARBON, steps=2),
        rod((0, 0.082, 0), (0, 0.10375, 0), 0.033, SILVER, collides=False),
    )


def _hand():
    return (
        rod((0, 0, 0), (0, 0, -0.030), 0.033, CARBON),
        *tube((0, 0, -0.030), (0, 0, -0.075), (0.035, 0.046), CARBON, steps=12),
        block((0.080, 0.072, 0.036), (0, 0, -0.093), CARBON),
        rod((0, 0, -0.074), (0, 0, -0.080), 0.0475, RING, collides=False),
        *(ball(knuckle, 0.013, SILVER) for knuckle, _ in FINGER_BASES),
    )
