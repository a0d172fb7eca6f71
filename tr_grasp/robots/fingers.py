"""Fingers that move together because their drives are told to, gripper by gripper: pure numpy, no simulator."""

from __future__ import annotations

from dataclasses import dataclass

from tr_grasp.robots.cartesian import DriveGain
from tr_grasp.robots.parts import Array, GripperSpec


@dataclass(frozen=True)
class CoupledFingers:
    """Drives a gripper that is data, as :class:`~tr_grasp.robots.cartesian.FingerDrive` drives the Panda's.

    The common setpoint is the way from closed (0) to open (1).

    Attributes:
        gripper: The fingers.
        speed_mps: How fast the opening changes.
        force_n: Force with which the fingers press.
    """

    gripper: GripperSpec
    speed_mps: float
    force_n: float

    @classmethod
    def of(cls, gripper: GripperSpec) -> CoupledFingers:
        """With the gripper's own speed and force."""
        return cls(gripper, gripper.speed_mps, gripper.force_n)

    @property
    def open_setpoint(self) -> float:
        """Setpoint of the open gripper."""
        return 1.0

    @property
    def open_positions(self) -> Array:
        """(joints,) of the open gripper."""
        return self.gripper.open

    @property
    def gains(self) -> tuple[DriveGain, ...]:
        """Of each joint, in the order of :attr:`GripperSpec.joints`."""
        return tuple(
            DriveGain(share * self.gripper.stiffness, share * self.gripper.stiffness / 30.0, joint.effort)
            for finger in self.gripper.fingers
            for joint, share in ((joint, finger.share) for joint in finger.joints)
        )

    def opening_m(self, fingers: Array) -> float:
        """Distance between the pads at joint positions (joints,)."""
        return self.gripper.opening_m(fingers)

    def reach_m(self, fingers: Array) -> float:
        """How far the fingertips at positions (joints,) reach beyond where they are when closed; linkages retract."""
        return self.gripper.tips_at(float(self.gripper.finger_openness(fingers).mean())) - self.gripper.tips_m[0]

    def targets(
        self, setpoint: float, closing: bool, fingers: Array, dt_s: float, goal: float | None = None
    ) -> tuple[float, Array]:
        """The next common setpoint and the position target of each joint (joints,).

        The setpoint stops at ``goal``, if there is one.

        The setpoint runs ahead of the fingers' mean by no more than what gives ``force_n``; twice a finger's
        deviation from the mean is taken off its target, which keeps the fingers centred as a real linkage does. A
        joint that follows is sent to where its own finger's driven joint says, so that fingertips stay parallel.
        """
        gripper = self.gripper
        openness = gripper.finger_openness(fingers)
        mean = float(openness.mean())
        slope = self._opening_slope_m(mean)
        step = self.speed_mps * dt_s / slope
        moved = max(setpoint - step, mean - self._lead(slope)) if closing else min(setpoint + step, 1.0)
        if goal is not None:
            moved = max(moved, goal) if closing else min(moved, goal)
        way = openness[gripper.finger_of_joint]
        way[gripper.lead] = moved - 2.0 * (openness - mean)
        return moved, gripper.closed + way * (gripper.open - gripper.closed)

    def _lead(self, slope_m: float) -> float:
        """Part of the way by which the setpoint must lead for ``force_n``: virtual work of pad and driven joint."""
        spans = (self.gripper.open - self.gripper.closed)[self.gripper.lead]
        return self.force_n * slope_m / 2 / (self.gripper.stiffness * float(spans @ spans) / len(spans))

    def _opening_slope_m(self, openness: float) -> float:
        """By how much the opening changes for the whole way at this rate."""
        # Fingers may be a little beyond their stops, where the simulator has pushed them.
        inside = min(max(openness, 0.0), 1.0)
        low, high = max(inside - 0.05, 0.0), min(inside + 0.05, 1.0)
        return (self.gripper.opening_at(high) - self.gripper.opening_at(low)) / (high - low)
