"""How far, how fast and how suddenly an arm may move."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from tr_grasp.errors import MotionError
from tr_grasp.motion.arguments import Array, Flags, joint_vector, one_of, positive
from tr_grasp.robots.spec import RobotSpec

LimitsName = Literal["thesis", "rated"]
MOVEIT_SCALING = 0.1
"""Part of speed and acceleration at which the thesis' MoveIt timed all that it planned."""
MOVEIT_ACCELERATION_RAD_S2 = 1.0
"""MoveIt's own, before scaling, where a robot's configuration names none; that of the thesis' arms did not."""


@dataclass(frozen=True, eq=False)
class MotionLimits:
    """Limits of each joint.

    Attributes:
        lower_rad, upper_rad: (dof,) positions.
        velocity_rad_s, acceleration_rad_s2, jerk_rad_s3: (dof,) magnitudes, the same in both directions.

    Raises:
        MotionError: A limit is not positive or not finite, the lower limit is not below the upper one, or their
            lengths differ.
    """

    lower_rad: Array
    upper_rad: Array
    velocity_rad_s: Array
    acceleration_rad_s2: Array
    jerk_rad_s3: Array

    def __post_init__(self) -> None:
        dof = np.size(self.velocity_rad_s)
        for name in ("velocity_rad_s", "acceleration_rad_s2", "jerk_rad_s3", "lower_rad", "upper_rad"):
            values = joint_vector(f"limits.{name}", getattr(self, name), dof)
            if name not in ("lower_rad", "upper_rad") and (values <= 0).any():
                raise MotionError(f"limits.{name} must be positive for every joint, got {values.tolist()}.")
            object.__setattr__(self, name, values)
        if (self.lower_rad >= self.upper_rad).any():
            raise MotionError(
                f"limits.lower_rad must be below limits.upper_rad, got {self.lower_rad.tolist()} "
                f"and {self.upper_rad.tolist()}."
            )

    @classmethod
    def of(cls, spec: RobotSpec, name: LimitsName = "rated") -> MotionLimits:
        """Limits of a robot: ``rated``, or those of the thesis' MoveIt: a tenth of the rated speed, and 0.1 rad/s².

        MoveIt's timing has no limit of jerk. A tenth of the rated one comes next to that: such an acceleration is there
        within a hundredth of a second.

        Raises:
            MotionError: No such name.
        """
        rated = cls(
            spec.lower_rad,
            spec.upper_rad,
            spec.velocity_limit_rad_s,
            spec.acceleration_limit_rad_s2,
            spec.jerk_limit_rad_s3,
        )
        if one_of("limits", name, get_args(LimitsName)) == "rated":
            return rated
        acceleration = np.minimum(rated.acceleration_rad_s2, MOVEIT_ACCELERATION_RAD_S2)
        return replace(rated, acceleration_rad_s2=acceleration).scaled(MOVEIT_SCALING)

    @property
    def dof(self) -> int:
        """Number of joints."""
        return len(self.velocity_rad_s)

    def scaled(self, share: float) -> MotionLimits:
        """The same positions with this share of speed, acceleration and jerk."""
        share = positive("share", share)
        return MotionLimits(
            self.lower_rad,
            self.upper_rad,
            share * self.velocity_rad_s,
            share * self.acceleration_rad_s2,
            share * self.jerk_rad_s3,
        )

    def hold(self, q: ArrayLike, tolerance_rad: float = 1e-6) -> Flags:
        """Whether positions (*batch, dof) are inside (*batch,)."""
        q = np.asarray(q, float)
        return np.asarray(((q >= self.lower_rad - tolerance_rad) & (q <= self.upper_rad + tolerance_rad)).all(-1))
