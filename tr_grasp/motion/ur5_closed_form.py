"""All postures in which a UR5 reaches a pose, in closed form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from ur_analytic_ik import ur5

from tr_grasp.geometry import invert_transform
from tr_grasp.motion.arguments import Array
from tr_grasp.motion.kinematics import Kinematics

BRANCHES_N = 8
_PROBES = np.array(
    [[0.1, -0.7, 1.1, 0.4, -1.3, 0.9], [-1.4, -1.9, -0.8, 2.0, 1.1, -2.2], [2.3, 0.3, 0.6, -1.2, 0.2, 3.0]]
)


@dataclass(frozen=True, eq=False)
class UR5ClosedForm:
    """Shoulder left or right, elbow up or down, wrist turned over or not: eight postures at most.

    Attributes:
        T_dh_base: From the arm's base link to the frame of the published Denavit-Hartenberg parameters.
        T_tcp_flange: From the flange to the tool.

    Source: the ``ur-analytic-ik`` library; Hawkins 2013, Analytic inverse kinematics for the Universal Robots UR-5.
    """

    T_dh_base: Array
    T_tcp_flange: Array

    @classmethod
    def of(cls, kinematics: Kinematics) -> UR5ClosedForm | None:
        """The solver of an arm, or nothing where the arm is not a UR5 with a tool: its poses are compared."""
        if kinematics.dof != 6:
            return None
        T_dh_base = np.diag([-1.0, -1.0, 1.0, 1.0])
        flanges = np.array([ur5.forward_kinematics(*q) for q in _PROBES])
        tools = T_dh_base @ kinematics.pose(_PROBES)
        T_flange_tcp = invert_transform(flanges[0]) @ tools[0]
        if np.abs(flanges @ T_flange_tcp - tools).max() > 1e-6:
            return None
        return cls(T_dh_base, invert_transform(T_flange_tcp))

    def branches(self, T_base_tcp: Array) -> Array:
        """(b, 8, 6) angles in [-π, π] of poses (b, 4, 4); NaN where a posture does not exist."""
        flanges = np.ascontiguousarray(self.T_dh_base @ T_base_tcp @ self.T_tcp_flange)
        q = np.full((len(flanges), BRANCHES_N, 6), np.nan)
        for i, flange in enumerate(flanges):
            for j, solution in enumerate(ur5.inverse_kinematics(flange)):
                q[i, j] = solution
        return q
