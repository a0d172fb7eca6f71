"""A tool that points straight down, moved in Cartesian steps: pure numpy, no simulator."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from tr_grasp.geometry import rotation_about_z

Array = NDArray[np.floating]


class Kinematics(Protocol):
    """Forward kinematics of an arm; joint angles (n,) [rad]."""

    def pose(self, q: Array) -> Array:
        """``T_base_tcp`` (4, 4)."""
        ...

    def jacobian(self, q: Array) -> Array:
        """(6, n): linear [m/rad] over angular [rad/rad] velocity of the tcp, expressed in the tcp frame."""
        ...


@dataclass(frozen=True)
class ToolLimits:
    """Where the tool may be sent, base frame.

    Attributes:
        lower_m, upper_m: (3,) corners of the allowed tcp positions.
        yaw_rad: Largest turn either way from the home orientation.
    """

    lower_m: Array
    upper_m: Array
    yaw_rad: float = 1.87


@dataclass(frozen=True)
class ToolTarget:
    """A tool pose with the tool pointing down: position (3,) [m] in the base frame and turn [rad] from home."""

    position: Array
    yaw_rad: float


def next_target(
    commanded: ToolTarget, measured_position: Array, step: Array, turn_rad: float, limits: ToolLimits
) -> ToolTarget:
    """The target one step further, inside the limits.

    Steps add to the commanded position, so that a steady control error does not make the tool creep; where contact
    holds the tool more than 5 mm back they add to the measured one, so that pushing does not wind up.
    """
    held_back = np.linalg.norm(commanded.position - measured_position) > 0.005
    origin = measured_position if held_back else commanded.position
    return ToolTarget(
        np.clip(origin + step, limits.lower_m, limits.upper_m),
        float(np.clip(commanded.yaw_rad + turn_rad, -limits.yaw_rad, limits.yaw_rad)),
    )


def pose_of(target: ToolTarget, R_base_home: Array) -> Array:
    """``T_base_tcp`` (4, 4) of a target, given the tool's orientation at home (3, 3)."""
    T = np.eye(4)
    T[:3, :3] = rotation_about_z(target.yaw_rad) @ R_base_home
    T[:3, 3] = target.position
    return T


def inverse_kinematics(
    kinematics: Kinematics,
    T_base_goal: Array,
    q_start: Array,
    lower: Array,
    upper: Array,
    iterations: int = 6,
    rest: Array | None = None,
) -> Array:
    """Joint angles (n,) near ``q_start`` whose tcp comes closest to a goal: damped least squares inside the limits.

    A goal out of reach gives the nearest pose that the iterations find, not an error: the arm then stops short.
    Where an arm with more than six joints may choose, it goes towards ``rest`` (n,); without it, its elbow drifts
    over hundreds of moves.
    Source: Nakamura & Hanafusa 1986, damped least squares.
    """
    q = q_start
    for _ in range(iterations):
        T = kinematics.pose(q)
        R = T[:3, :3]
        offset = T_base_goal[:3, 3] - T[:3, 3]
        turn = _small_rotation(T_base_goal[:3, :3] @ R.T)
        if offset @ offset < 1e-10 and turn @ turn < 1e-8:
            break
        error = np.concatenate([R.T @ offset, R.T @ turn])
        J = kinematics.jacobian(q)
        JJ = J @ J.T + 1e-5 * np.eye(6)
        dq = J.T @ np.linalg.solve(JJ, error)
        if rest is not None:
            towards = REST_GAIN * (rest - q)
            dq = dq + towards - J.T @ np.linalg.solve(JJ, J @ towards)
        largest = np.abs(dq).max()
        q = np.clip(q + dq * min(1.0, 0.5 / max(largest, 1e-12)), lower, upper)
    return q


REST_GAIN = 0.05
"""Part of the way to rest that an iteration takes."""


def _small_rotation(R: Array) -> Array:
    """(3,) rotation vector of a small rotation (first order)."""
    return 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])


class DriveGain(NamedTuple):
    """Spring, damper and largest force of a joint's drive [N/m, N s/m, N; N m/rad, ... for turning joints]."""

    stiffness: float
    damping: float
    force_limit: float


class Fingers(Protocol):
    """How a controller moves the fingers of a gripper: from one common setpoint."""

    @property
    def open_setpoint(self) -> float:
        """Setpoint of the open gripper."""
        ...

    @property
    def open_positions(self) -> Array:
        """(joints,) of the open gripper."""
        ...

    @property
    def gains(self) -> Sequence[DriveGain]:
        """Of each joint."""
        ...

    def opening_m(self, fingers: Array) -> float:
        """Distance between the pads at joint positions (joints,)."""
        ...

    def reach_m(self, fingers: Array) -> float:
        """How far the fingertips at positions (joints,) reach beyond where they are when closed."""
        ...

    def targets(self, setpoint: float, closing: bool, fingers: Array, dt_s: float) -> tuple[float, Array]:
        """The next setpoint, and the target of each joint (joints,), from their positions now."""
        ...


@dataclass(frozen=True)
class FingerDrive:
    """A two-finger gripper whose fingers are coupled by their drives.

    Attributes:
        open_m: Finger travel when open (half the opening).
        speed_mps: Speed of one finger.
        force_n: Force with which each finger presses.
        stiffness: Proportional gain of the finger drives [N/m].
    """

    open_m: float = 0.04
    speed_mps: float = 0.2
    force_n: float = 40.0
    stiffness: float = 1000.0

    @property
    def open_setpoint(self) -> float:
        """Setpoint of the open gripper."""
        return self.open_m

    @property
    def open_positions(self) -> Array:
        """(2,) of the open gripper."""
        return np.full(2, self.open_m)

    @property
    def gains(self) -> tuple[DriveGain, ...]:
        """Of each finger."""
        return (DriveGain(self.stiffness, 1e2, 150.0),) * 2

    def opening_m(self, fingers: Array) -> float:
        """Distance between the fingers at positions (2,)."""
        return float(fingers.sum())

    def reach_m(self, fingers: Array) -> float:
        """Nothing: these fingers slide straight."""
        return 0.0

    def targets(self, setpoint: float, closing: bool, fingers: Array, dt_s: float) -> tuple[float, Array]:
        """The next common setpoint and the position target of each finger (2,) [m].

        The setpoint runs ahead of the fingers' mean by no more than what gives ``force_n``; twice a finger's
        deviation from the mean is taken off its target, which keeps the fingers centred as a real linkage does.
        """
        mean = float(fingers.mean())
        lead = self.force_n / self.stiffness
        step = self.speed_mps * dt_s
        moved = max(setpoint - step, mean - lead) if closing else min(setpoint + step, self.open_m)
        return moved, moved - 2.0 * (fingers - mean)
