"""What the arm must not touch while something moves: one collision model for the way, one for the grasp."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from tr_grasp.dynamic.method import DynamicTask
from tr_grasp.dynamic.target import Forecast
from tr_grasp.motion import CollisionModel, Kinematics, Obstacle, Trajectory, box, convex
from tr_grasp.motion.limits import LimitsName

Array = NDArray[np.floating]

OBJECT_MARGIN_M = 0.004
"""How far the arm stays off the object on its way; the covariance of the forecast comes on top, through the score."""
WAY_MARGIN_M: dict[LimitsName, float] = {"rated": 0.01, "thesis": 0.005}
"""How far it stays off what stands around, there: drives lag behind quick motions by some millimetres."""
GRASP_MARGIN_M = 0.005
"""And at a grasp, where it is slow."""
CHECK_PERIOD_S, CHECK_RAD = 0.04, 0.04
"""Between two checks of a motion: the longest time, and how far a joint turns at most. At the end of an arm that is
less than it takes to pass through a finger and a board."""


@dataclass(frozen=True, eq=False)
class Scene:
    """The arm among obstacles, of which the object and its carrier move as forecast.

    Attributes:
        kinematics: The arm, its fingers open.
        way: Nothing may be touched.
        grasp: The hand may touch the object, and comes nearer to what stands around.
    """

    kinematics: Kinematics
    way: CollisionModel
    grasp: CollisionModel
    _forecast: list[Forecast] = field(repr=False)

    @classmethod
    def of(cls, kinematics: Kinematics, task: DynamicTask, q: Array, limits: LimitsName = "rated") -> Scene:
        """That of a task, the arm at joints (dof,); call :meth:`expect` before anything is asked."""
        forecast: list[Forecast] = []

        def object_poses(times_s: Array) -> Array:
            return forecast[0].poses(times_s)

        def carrier_poses(times_s: Array) -> Array:
            return object_poses(times_s) @ task.T_target_carrier

        def model(still_m: float, object_m: float, may_touch: tuple[str, ...]) -> CollisionModel:
            obstacles = apart_from(kinematics, task.obstacles, q, still_m)
            given = {"margin_m": object_m, "motion": object_poses, "may_touch": may_touch}
            parts = [
                convex(f"target part {i}", part.vertices, np.eye(4), **given) for i, part in enumerate(task.model.parts)
            ]
            carrier = box("carrier", task.carrier_size_m, np.eye(4), motion=carrier_poses)
            return CollisionModel(kinematics, [*obstacles, carrier, *parts])

        way = model(WAY_MARGIN_M[limits], OBJECT_MARGIN_M, ())
        return cls(kinematics, way, model(GRASP_MARGIN_M, 0.0, hand_links(kinematics)), forecast)

    def expect(self, forecast: Forecast) -> None:
        """From now on, the object moves like this."""
        self._forecast[:] = [forecast]

    def is_free(self, trajectory: Trajectory, from_s: float) -> bool:
        """Whether nothing is touched on the way along a trajectory that starts at a time."""
        return self._is_free(self.way, trajectory, from_s, trajectory.duration_s)

    def is_free_at_grasp(self, trajectory: Trajectory, from_s: float, until_s: float) -> bool:
        """Whether nothing but the object is touched, up to a later time; at the start in any case."""
        return self._is_free(self.grasp, trajectory, from_s, until_s - from_s)

    @staticmethod
    def _is_free(model: CollisionModel, trajectory: Trajectory, from_s: float, duration_s: float) -> bool:
        quickest_rad_s = max(float(trajectory.peaks()["velocity"].max()), CHECK_RAD / CHECK_PERIOD_S)
        times, state = trajectory.every(CHECK_RAD / quickest_rad_s)
        kept = times <= max(duration_s, 0.0) + 1e-9
        return model.all_free(state.q[kept], times[kept] + from_s)


def apart_from(
    kinematics: Kinematics, obstacles: Sequence[Obstacle], q: Array, margin_m: float
) -> tuple[Obstacle, ...]:
    """The obstacles with a margin, but for those that the arm is nearer to at first.

    An arm that leans on something has to be able to leave; no way out of a contact would be free of it. What the arm is
    only too near to goes without the margin; what it touches does not mind the links that do.
    """
    left = [_grown(obstacle, margin_m) for obstacle in obstacles]
    while contact := CollisionModel(kinematics, left).contact(q):
        touched = [i for i, obstacle in enumerate(left) if obstacle.name == contact.second]
        if not touched:
            break  # the arm itself, which nothing here can excuse
        i = touched[0]
        if left[i].geometry is obstacles[i].geometry:
            left[i] = replace(left[i], may_touch=(*left[i].may_touch, contact.first))
        else:
            left[i] = obstacles[i]
    return tuple(left)


def _grown(obstacle: Obstacle, margin_m: float) -> Obstacle:
    if not hasattr(obstacle.geometry, "setSweptSphereRadius"):
        return obstacle  # an octree: its leaves are larger than what they hold
    geometry = obstacle.geometry.clone()
    geometry.setSweptSphereRadius(max(geometry.getSweptSphereRadius(), margin_m))
    return replace(obstacle, geometry=geometry)


def hand_links(kinematics: Kinematics) -> tuple[str, ...]:
    """Links beyond the last joint of the arm, as its collision model knows them."""
    spec = kinematics.spec
    arm = {spec.base_link, *(joint.child for joint in spec.joints)}
    frames = {frame.name for frame in kinematics.model.frames}
    return tuple(link.name for link in spec.links if link.name not in arm and link.name in frames)
