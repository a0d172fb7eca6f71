"""How far, how fast and how suddenly an arm may move."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from tr_grasp.errors import MotionError
from tr_grasp.motion.arguments import Array, Flags, joint_vector, one_of, positive
from tr_grasp.robots.spec import RobotSpec

LimitsName = Literal["thesis", "rated"]
SHARE: dict[str, float] = {"thesis": 0.1, "rated": 1.0}
"""Part of the rated speed, acceleration and jerk; the thesis' MoveIt scaled all motion to a tenth."""


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
        """Limits of a robot: ``rated``, or ``thesis`` for a tenth of the rated speed, acceleration and jerk.

        Raises:
            MotionError: No such name.
        """
        share = SHARE[one_of("limits", name, SHARE)]
        return cls(
            spec.lower_rad,
            spec.upper_rad,
            share * spec.velocity_limit_rad_s,
            share * spec.acceleration_limit_rad_s2,
            share * spec.jerk_limit_rad_s3,
        )

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
