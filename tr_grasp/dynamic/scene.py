"""What the arm must not touch while something moves: one collision model for the way, one for the grasp."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from tr_grasp.dynamic.method import DynamicTask
from tr_grasp.dynamic.target import Forecast
from tr_grasp.motion import CollisionModel, Kinematics, Obstacle, Trajectory, box, convex

Array = NDArray[np.floating]

OBJECT_MARGIN_M = 0.004
"""How far the arm stays off the object on its way; the covariance of the forecast comes on top, through the score."""
OBSTACLE_MARGIN_M = 0.005
"""How far it stays off what stands around."""
CHECK_PERIOD_S = 0.04


@dataclass(frozen=True, eq=False)
class Scene:
    """The arm among obstacles, of which the object and its carrier move as forecast.

    Attributes:
        kinematics: The arm, its fingers open.
        way: Nothing may be touched.
        grasp: The hand may touch the object.
    """

    kinematics: Kinematics
    way: CollisionModel
    grasp: CollisionModel
    _forecast: list[Forecast] = field(repr=False)

    @classmethod
    def of(cls, kinematics: Kinematics, task: DynamicTask, q: Array) -> Scene:
        """That of a task, the arm at joints (dof,); call :meth:`expect` before anything is asked."""
        forecast: list[Forecast] = []
        obstacles = apart_from(kinematics, task.obstacles, q)

        def object_poses(times_s: Array) -> Array:
            return forecast[0].poses(times_s)

        def carrier_poses(times_s: Array) -> Array:
            return object_poses(times_s) @ task.T_target_carrier

        def model(margin_m: float, may_touch: tuple[str, ...]) -> CollisionModel:
            given = {"margin_m": margin_m, "motion": object_poses, "may_touch": may_touch}
            parts = [
                convex(f"target part {i}", part.vertices, np.eye(4), **given) for i, part in enumerate(task.model.parts)
            ]
            carrier = box("carrier", task.carrier_size_m, np.eye(4), motion=carrier_poses)
            return CollisionModel(kinematics, [*obstacles, carrier, *parts])

        return cls(kinematics, model(OBJECT_MARGIN_M, ()), model(0.0, hand_links(kinematics)), forecast)

    def expect(self, forecast: Forecast) -> None:
        """From now on, the object moves like this."""
        self._forecast[:] = [forecast]

    def is_free(self, trajectory: Trajectory, from_s: float, until_s: float | None = None) -> bool:
        """Whether nothing is touched along a trajectory that starts at a time, or up to a later time."""
        times, state = trajectory.every(CHECK_PERIOD_S)
        kept = times <= (trajectory.duration_s if until_s is None else until_s - from_s) + 1e-9
        return self.way.all_free(state.q[kept], times[kept] + from_s)


def apart_from(kinematics: Kinematics, obstacles: Sequence[Obstacle], q: Array) -> tuple[Obstacle, ...]:
    """The obstacles with a margin; those that links touch where the arm is at first do not mind these links.

    An arm that leans on something has to be able to leave; no way out of a contact would be free of it.
    """
    left = [_grown(obstacle) for obstacle in obstacles]
    while contact := CollisionModel(kinematics, left).contact(q):
        touched = [i for i, obstacle in enumerate(left) if obstacle.name == contact.second]
        if not touched:
            break  # the arm itself, which nothing here can excuse
        i = touched[0]
        left[i] = replace(left[i], may_touch=(*left[i].may_touch, contact.first))
    return tuple(left)


def _grown(obstacle: Obstacle) -> Obstacle:
    if not hasattr(obstacle.geometry, "setSweptSphereRadius"):
        return obstacle  # an octree: its leaves are larger than what they hold
    geometry = obstacle.geometry.clone()
    geometry.setSweptSphereRadius(max(geometry.getSweptSphereRadius(), OBSTACLE_MARGIN_M))
    return replace(obstacle, geometry=geometry)


def hand_links(kinematics: Kinematics) -> tuple[str, ...]:
    """Links beyond the last joint of the arm, as its collision model knows them."""
    spec = kinematics.spec
    arm = {spec.base_link, *(joint.child for joint in spec.joints)}
    frames = {frame.name for frame in kinematics.model.frames}
    return tuple(link.name for link in spec.links if link.name not in arm and link.name in frames)
