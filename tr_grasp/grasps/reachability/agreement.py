"""Does the sign of a reachability field say what inverse kinematics says?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tr_grasp.grasps.reachability.field import ReachabilityField
from tr_grasp.grasps.reachability.labels import Labeller
from tr_grasp.motion import Kinematics
from tr_grasp.robots import RobotSpec

Array = NDArray[np.floating]


@dataclass(frozen=True, eq=False)
class Agreement:
    """Margins and labels of fresh poses.

    Attributes:
        margin_m: (n,) what the field says.
        is_reachable: (n,) what inverse kinematics and collision checks say.
    """

    margin_m: Array
    is_reachable: NDArray[np.bool_]

    def beyond(self, margin_m: float) -> tuple[int, int]:
        """How many poses have the right sign, of how many whose margin is larger than this."""
        sure = np.abs(self.margin_m) > margin_m
        right = (self.margin_m > 0) == self.is_reachable
        return int((right & sure).sum()), int(sure.sum())


def agreement(field: ReachabilityField, spec: RobotSpec, poses_n: int, seed: int) -> Agreement:
    """Compare on poses that are uniform in the field's domain, over all rotations.

    Raises:
        GraspError: The field was made for another arm.
    """
    field.require_for(spec)
    T = field.domain.sample(poses_n, np.random.default_rng([seed, 99]))
    label = Labeller(Kinematics(spec), float(field.settings["floor_m"]))
    return Agreement(field.values(T), label(T))
