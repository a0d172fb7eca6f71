"""Kinova's three-finger hand (KG-3) of the j2s7s300, simplified.

A fingertip turns back as its finger turns in, so that its face stays parallel to the hand's axis; the real ones are
underactuated and fold around what they meet. Origins: Kinova's ``kinova_finger_set.xacro`` (BSD-3).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from tr_grasp.geometry import rotation_about_z, transform_points
from tr_grasp.robots.chain import joint_transform
from tr_grasp.robots.parts import Array, FingerSpec, GripperSpec, JointSpec, LinkSpec, Vector
from tr_grasp.robots.solids import ball, block, rod

PREFIX = "j2s7s300_"
CARBON: Vector = (0.15, 0.16, 0.18)
SILVER: Vector = (0.70, 0.71, 0.73)
RUBBER: Vector = (0.12, 0.12, 0.13)

TCP_BEYOND_LINK_7_M = 0.1850
PAD_INSET_M = 0.0220
"""From a fingertip's joint to the surface that grips, across the hand."""
CURL_RAD = 0.52
"""The fingertips lean inwards by this much from the hand's axis."""
PAD_M: Vector = (0.020, 0.008, 0.026)
PAD_CENTRE_M = 0.023
"""Size of that surface's body, and how far its centre lies beyond the fingertip's joint."""
SAMPLES = 65


FINGER_BASES: tuple[tuple[Vector, Vector], ...] = (
    ((0.00279, 0.03126, -0.11467), (-1.7047873384941834, 0.6476144647144773, 1.67317415161155)),
    ((0.02226, -0.02707, -0.11482), (-1.570796327, 0.649262481663582, -1.38614049188413)),
    ((-0.02226, -0.02707, -0.11482), (-1.570796327, 0.649262481663582, -1.75545216211587)),
)
"""Where the fingers start on the hand (``kinova_finger_set.xacro``): the thumb, and the two that oppose it."""
TIP_JOINT: Vector = (0.044, -0.003, 0.0)


def kg3_fingers(hand: str) -> tuple[list[FingerSpec], list[LinkSpec]]:
    """The thumb and the two fingers that oppose it, on a link of the hand; and their links."""
    fingers, links = [], []
    for number, (xyz, rpy) in enumerate(FINGER_BASES, start=1):
        names = (f"{PREFIX}link_finger_{number}", f"{PREFIX}link_finger_tip_{number}")
        joints = (
            JointSpec(
                f"{PREFIX}joint_finger_{number}", hand, names[0], "revolute", xyz, rpy, upper=1.51, velocity=1.0,
                acceleration=50.0, jerk=5e3, effort=10.0,
            ),
            JointSpec(
                f"{PREFIX}joint_finger_tip_{number}", names[0], names[1], "revolute", TIP_JOINT, upper=2.0,
                velocity=1.0, acceleration=50.0, jerk=5e3, effort=10.0,
            ),
        )  # fmt: skip
        T_hand_finger = joint_transform(joints[0])
        inwards = -float(np.sign(xyz[1]))
        both, closed = _turn_of_both(T_hand_finger, inwards), _turn_when_closed(T_hand_finger, inwards)
        R_tip_hand = (T_hand_finger[:3, :3] @ rotation_about_z(both)).T
        points = [
            _vector(R_tip_hand @ [0.0, inwards * PAD_INSET_M, z]) for z in (-PAD_CENTRE_M, -PAD_CENTRE_M - PAD_M[2] / 2)
        ]
        links += [_finger_link(names[0]), _fingertip_link(names[1], R_tip_hand, inwards)]
        fingers.append(
            FingerSpec(
                joints,
                closed=(closed, both - closed),
                open=(0.0, both),
                links=(names[1], names[0]),
                pad_link=names[1],
                pad_point_m=points[0],
                tip_point_m=points[1],
                share=1.0 if number == 1 else 0.5,
            )
        )
    return fingers, links


def _turn_of_both(T_hand_finger: Array, inwards: float) -> float:
    """Turn of finger and fingertip together after which the fingertip leans inwards by ``CURL_RAD``."""
    y, z = inwards * np.sin(CURL_RAD), -np.cos(CURL_RAD)
    along, across = T_hand_finger[1:3, 0], T_hand_finger[1:3, 1]
    return float(np.arctan2(along[1] * y - along[0] * z, across[0] * z - across[1] * y) % np.pi)


def _turn_when_closed(T_hand_finger: Array, inwards: float) -> float:
    """Turn of the finger that brings the surface that grips to the hand's middle."""
    x, y, _ = TIP_JOINT
    along, across = T_hand_finger[1, 0], T_hand_finger[1, 1]
    a, b = along * x + across * y, across * x - along * y
    way = -inwards * PAD_INSET_M - T_hand_finger[1, 3]
    turns = np.arctan2(b, a) + np.array([-1.0, 1.0]) * np.arccos(way / np.hypot(a, b))
    return float(next(turn for turn in turns if 0.0 < turn < 1.51))


def kg3_gripper(fingers: list[FingerSpec]) -> GripperSpec:
    """The fingers as a gripper; its opening is the thumb's distance from the middle of the others."""
    samples = [_pads_and_tips(fingers, openness) for openness in np.linspace(0.0, 1.0, SAMPLES)]
    return GripperSpec(
        tuple(fingers),
        openings_m=tuple(opening for opening, _ in samples),
        tips_m=tuple(tip - TCP_BEYOND_LINK_7_M for _, tip in samples),
        speed_mps=0.080,
        speed_range_mps=(0.010, 0.100),
        force_n=25.0,
        force_range_n=(5.0, 25.0),
        stiffness=20.0,
    )


def _pads_and_tips(fingers: list[FingerSpec], openness: float) -> tuple[float, float]:
    """Distance of the thumb's surface from the other two [m], and how far the lowest tip is from link 7 [m]."""
    across, beyond = [], []
    for finger in fingers:
        q = np.array(finger.closed) + openness * (np.array(finger.open) - np.array(finger.closed))
        T = joint_transform(finger.joints[0], q[0]) @ joint_transform(finger.joints[1], q[1])
        across.append(transform_points(T, np.array(finger.pad_point_m))[1])
        beyond.append(-transform_points(T, np.array(finger.tip_point_m))[2])
    return float(across[0] - np.mean(across[1:])), float(max(beyond))


def _finger_link(name: str) -> LinkSpec:
    x, y, z = TIP_JOINT
    shapes = (
        block((0.040, 0.015, 0.018), (0.022, -0.003, 0.0), CARBON),
        rod((0.0, 0.0, -0.0105), (0.0, 0.0, 0.0105), 0.0095, SILVER, collides=False),
        rod((x, y, z - 0.0105), (x, y, z + 0.0105), 0.0085, SILVER, collides=False),
    )
    return LinkSpec(name, 0.02, (0.022, 0.0, 0.0), (4e-6, 8e-6, 8e-6, 0.0, 0.0, 0.0), shapes)


def _fingertip_link(name: str, R_tip_hand: Array, inwards: float) -> LinkSpec:
    """A curved phalanx, and the face that grips, parallel to the hand's axis."""
    rpy = _rpy(R_tip_hand)
    width, thickness, height = PAD_M

    def at(y: float, z: float) -> Vector:
        return _vector(R_tip_hand @ [0.0, inwards * y, z])

    behind = PAD_INSET_M - thickness / 2
    shapes = (
        block(PAD_M, at(behind, -PAD_CENTRE_M), RUBBER, rpy),
        rod((0.0, 0.0, 0.0), at(behind - 0.004, -0.6 * PAD_CENTRE_M), 0.0075, CARBON),
        ball(at(behind - 0.004, -0.6 * PAD_CENTRE_M), 0.0085, CARBON),
        block(
            (0.9 * width, 0.7 * thickness, 0.8 * height), at(behind - 0.006, -PAD_CENTRE_M), CARBON, rpy, collides=False
        ),
    )
    return LinkSpec(name, 0.02, at(0.6 * PAD_INSET_M, -0.6 * PAD_CENTRE_M), (4e-6, 8e-6, 8e-6, 0.0, 0.0, 0.0), shapes)


def _rpy(R: Array) -> Vector:
    """Roll, pitch, yaw (3,) of a rotation (3, 3), as URDF has them."""
    return _vector([np.arctan2(R[2, 1], R[2, 2]), -np.arcsin(np.clip(R[2, 0], -1, 1)), np.arctan2(R[1, 0], R[0, 0])])


def _vector(values: Any) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z
