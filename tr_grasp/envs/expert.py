"""A scripted expert that sees the true scene: for demonstrations, labels and sanity checks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tr_grasp.configs import ActionCfg
from tr_grasp.geometry import wrap_half_turn
from tr_grasp.grasps import Grasp, TopDownGrasps
from tr_grasp.keys import CLOSE, OPEN

Array = NDArray[np.floating]
LIFT = 0.5
MOVING_MPS = 0.02
"""Fingers faster than this are still on their way."""
WAIT_ABOVE_M = 0.05
"""Fingers less than half open are waited for at this height over a grasp."""
SHUT_M = 0.004
"""Fingers as near to each other as this hold nothing, or something so thin that no observation tells which."""
LOOK_ABOVE_M = 0.08
"""They are opened only this high over the next grasp, where the camera shows that nothing hangs between them."""


@dataclass(frozen=True)
class ToolState:
    """What the expert knows of the gripper.

    Attributes:
        position: (3,) tcp [m], base frame.
        closing_yaw_rad: Direction of closing in the table's plane.
        closing: The gripper was last told to close.
        holding: An object is pinched.
        opening_m: Measured distance between the fingers.
        opening_speed_mps: How fast it grows.
    """

    position: Array
    closing_yaw_rad: float
    closing: bool
    holding: bool
    opening_m: float
    opening_speed_mps: float = 0.0


def choose_grasp(grasps: TopDownGrasps, tool: ToolState, centre_m: Array) -> int | None:
    """The grasp that is worth most from where the tool is: good, near, with little to turn, and near the centre.

    Nearness makes the choice settle as the tool approaches without the expert having to remember anything. By itself it
    would leave the tool in the middle of a book equally far from all corners, and an imitator, which learns the mean
    of what it is shown, would stay there for ever. The nearness to the centre decides, whichever way the scene is turned or
    mirrored.

    Args:
        grasps: To choose from.
        tool: The gripper.
        centre_m: (2,) centre of the workspace, base frame.
    """
    if not len(grasps):
        return None
    distance = np.linalg.norm(grasps.position[:, :2] - tool.position[:2], axis=1)
    turn = np.abs(wrap_half_turn(grasps.yaw_rad - tool.closing_yaw_rad))
    outwards = np.linalg.norm(grasps.position[:, :2] - centre_m, axis=1)
    return int(np.argmax(grasps.score - distance / 0.15 - 0.25 * turn - outwards / 0.2))


def expert_action(tool: ToolState, grasp: Grasp, action: ActionCfg, opening_m: float) -> NDArray[np.float32]:
    """(5,) action towards a grasp.

    It is a continuous function of the state, so that it can be imitated: a funnel of heights opens over the grasp and
    the tool may only be as low as its sideways error allows. Labels tolerate errors that one camera cannot show;
    stricter ones teach the imitator to hesitate. Slow fingers are waited for: the tool neither lets go while they close
    nor comes down before they are half open. Shut fingers rise before they open, as if a thin rim were between them,
    because an imitator that lets go of nothing lets go of rims, too.

    Args:
        tool: The gripper.
        grasp: Where it is to go.
        action: What a step does.
        opening_m: Distance between the open fingers.
    """
    offset = grasp.position - tool.position
    turn = float(wrap_half_turn(grasp.yaw_rad - tool.closing_yaw_rad))
    sideways = float(np.hypot(offset[0], offset[1]))
    if tool.closing and tool.opening_m < SHUT_M:
        return lift_action() if offset[2] > -LOOK_ABOVE_M else wait_action()
    if tool.closing and tool.opening_speed_mps < -MOVING_MPS:
        return _pack(np.zeros(3), 0.0, CLOSE)
    tolerance = float(np.clip((opening_m - grasp.width_m) / 2 - 0.002, 0.005, 0.012))
    # A few millimetres above a pen the fingers would close over it.
    too_high = float(np.clip(0.4 * grasp.depth_m, 0.003, 0.010))
    if sideways < tolerance and abs(turn) < 0.35 and offset[2] > -too_high:
        return _pack(np.zeros(3), 0.0, CLOSE)
    hover = np.clip(1.6 * max(0.0, sideways - tolerance) + 0.08 * max(0.0, abs(turn) - 0.25), 0.0, 0.08)
    if tool.opening_m < opening_m / 2:
        hover = max(hover, WAIT_ABOVE_M)
    climb = offset[2] + hover
    slow = 0.35 if climb > 0.03 else 1.0
    step = np.array([slow * offset[0], slow * offset[1], climb]) / action.translation_step_m
    return _pack(step, slow * turn / action.yaw_step_rad, OPEN)


def target_from_tool(tool: ToolState, grasp: Grasp) -> NDArray[np.float32]:
    """(6,) where a grasp lies from the tool: offset [m], cosine and sine of twice the turn, 1.

    Twice the turn, because a two-finger gripper is the same after half a turn.
    """
    turn = 2 * (grasp.yaw_rad - tool.closing_yaw_rad)
    return np.array([*(grasp.position - tool.position), np.cos(turn), np.sin(turn), 1.0], np.float32)


def no_target() -> NDArray[np.float32]:
    """(6,) zeros: nothing to go to."""
    return np.zeros(6, np.float32)


def lift_action() -> NDArray[np.float32]:
    """Rise straight up with a closed gripper: an object is held.

    Not at full speed, because the jerk of the start would shake loose what hangs by a rim or a slope.
    """
    return _pack(np.array([0.0, 0.0, LIFT]), 0.0, CLOSE)


def wait_action() -> NDArray[np.float32]:
    """Rise with an open gripper: there is nothing to grasp."""
    return _pack(np.array([0.0, 0.0, 0.5]), 0.0, OPEN)


def _pack(step: Array, turn: float, gripper: float) -> NDArray[np.float32]:
    return np.clip(np.array([*step, turn, gripper]), -1.0, 1.0).astype(np.float32)
