"""What a planner of top-down grasps must know of a gripper."""

from __future__ import annotations

from dataclasses import dataclass

from tr_grasp.robots import robot_spec


@dataclass(frozen=True)
class GripperShape:
    """A gripper seen from above; u is the closing direction, w across it. Defaults: Franka hand.

    Attributes:
        opening_m: Distance between the open fingers.
        finger_thickness_m, pad_width_m: Size of a finger along u and w.
        tip_below_tcp_m: How far the fingertips reach below the tcp.
        palm_above_tcp_m: Height of the palm over the tcp.
        palm_u_m, palm_w_m: Half extents of the palm.
        clearance_m: Space kept between gripper and scene.
    """

    opening_m: float = 0.08
    finger_thickness_m: float = 0.018
    pad_width_m: float = 0.018
    tip_below_tcp_m: float = 0.0095
    palm_above_tcp_m: float = 0.037
    palm_u_m: float = 0.10
    palm_w_m: float = 0.032
    clearance_m: float = 0.003


FRANKA_HAND = GripperShape()

_SHAPES = {
    "panda": FRANKA_HAND,
    "ur5_rg2": GripperShape(
        opening_m=0.110,
        finger_thickness_m=0.028,
        pad_width_m=0.020,
        palm_above_tcp_m=0.020,
        palm_u_m=0.083,
        palm_w_m=0.019,
    ),
    "ur5_robotiq_2f85": GripperShape(
        opening_m=0.085,
        finger_thickness_m=0.018,
        pad_width_m=0.022,
        palm_above_tcp_m=0.030,
        palm_u_m=0.076,
        palm_w_m=0.020,
    ),
    # Its thumb meets two fingers that stand side by side, so all three are as wide as those two together.
    "j2s7s300": GripperShape(
        opening_m=0.087,
        finger_thickness_m=0.018,
        pad_width_m=0.078,
        palm_above_tcp_m=0.026,
        palm_u_m=0.075,
        palm_w_m=0.045,
    ),
}
"""Linkages swing inwards and their fingertips retract, so the palm is where their cranks are when they are open."""


def gripper_shape(robot: str) -> GripperShape:
    """The gripper of a robot, by name; of a user's own, by YAML, only opening and fingertips are known.

    Raises:
        ConfigError: No such robot.
    """
    if robot in _SHAPES:
        return _SHAPES[robot]
    gripper = robot_spec(robot).gripper
    return GripperShape(opening_m=gripper.opening_range_m[1], tip_below_tcp_m=gripper.tips_m[0])
