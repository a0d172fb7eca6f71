"""Does an arm touch itself or what is around it, and how far away is it (coal, through Pinocchio)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from tr_grasp.errors import MotionError
from tr_grasp.motion.arguments import Array, Flags, joint_rows, joint_vector, one_of
from tr_grasp.motion.kinematics import Kinematics
from tr_grasp.motion.obstacles import Obstacle
from tr_grasp.motion.self_collision import arm_shapes, self_collision_matrix
from tr_grasp.motion.trajectory import Trajectory


@dataclass(frozen=True)
class Contact:
    """Two bodies that touch: links of the arm by their name, obstacles by theirs."""

    first: str
    second: str

    def __str__(self) -> str:
        return f"{self.first} touches {self.second}"


@dataclass(frozen=True)
class Clearance:
    """The nearest two bodies and the distance between them; negative where they overlap."""

    distance_m: float
    first: str
    second: str


class CollisionModel:
    """An arm among obstacles. Cheap to build, so a scene that changed is a new model.

    A moving obstacle is a joint of its own in Pinocchio's model, so that many joint vectors at many times are one call.
    The base of the arm, which never moves, is checked against nothing but the arm.

    Args:
        kinematics: The arm.
        obstacles: Their names are unique.

    Raises:
        MotionError: Two obstacles of one name, or a link in ``may_touch`` that the arm does not have.
    """

    def __init__(self, kinematics: Kinematics, obstacles: Sequence[Obstacle] = ()) -> None:
        self.kinematics, self.obstacles = kinematics, tuple(obstacles)
        names = [obstacle.name for obstacle in obstacles]
        if repeated := sorted({name for name in names if names.count(name) > 1}):
            raise MotionError(f"obstacles must have names of their own, got two called {repeated[0]!r}.")
        self._model = pin.Model(kinematics.model)
        self._shapes = arm_shapes(kinematics)
        frames = kinematics.model.frames
        self._names = [frames[shape.parentFrame].name for shape in self._shapes.geometryObjects]
        for first, second in self_collision_matrix(kinematics).checked:
            self._shapes.addCollisionPair(pin.CollisionPair(first, second))
        self._self_pairs_n = self.pairs_n
        self._moving: list[Obstacle] = []
        arm_n = len(self._names)
        for obstacle in self.obstacles:
            self._add(obstacle, arm_n)
        self._data, self._results = self._model.createData(), self._shapes.createData()
        self._pool: pin.TreeBroadPhaseManagerPool_DynamicAABBTreeCollisionManager | None = None

    def _add(self, obstacle: Obstacle, arm_n: int) -> None:
        links = {frame.name for frame in self.kinematics.model.frames}
        for link in obstacle.may_touch:
            one_of("link", link, links)
        joint, placement = 0, pin.SE3(obstacle.T_base_obstacle)
        if obstacle.motion is not None:
            free = pin.JointModelFreeFlyer()
            joint = self._model.addJoint(0, free, pin.SE3.Identity(), f"obstacle {obstacle.name}")
            placement = pin.SE3.Identity()
            self._moving.append(obstacle)
        shape = pin.GeometryObject(f"obstacle {obstacle.name}", joint, 0, placement, obstacle.geometry)
        index = self._shapes.addGeometryObject(shape)
        self._names.append(obstacle.name)
        for i in range(arm_n):
            moves = self._shapes.geometryObjects[i].parentJoint > 0
            if moves and self._names[i] not in obstacle.may_touch:
                self._shapes.addCollisionPair(pin.CollisionPair(i, index))

    @property
    def pairs_n(self) -> int:
        """Pairs of shapes that are checked."""
        return len(self._shapes.collisionPairs)

    def free(self, q: ArrayLike, times_s: ArrayLike = 0.0) -> Flags:
        """Whether nothing touches at joints (n, dof), (n,); a single vector is one row.

        Args:
            q: Joints.
            times_s: When, one time for all or (n,); matters to moving obstacles.

        Raises:
            MotionError: NaN or another number of joints.
        """
        return ~self._collide(self._states(joint_rows("q", q, self.kinematics.dof), times_s), stop_early=False)

    def all_free(self, q: Array, times_s: ArrayLike = 0.0) -> bool:
        """Whether nothing touches at any of the joints (n, dof); stops at the first contact. Nothing is validated."""
        return not self._collide(self._states(q, times_s), stop_early=True).any()

    def contact(self, q: ArrayLike, time_s: float = 0.0) -> Contact | None:
        """Two bodies that touch at joints (dof,), or nothing.

        Raises:
            MotionError: NaN or another number of joints.
        """
        state = self._states(joint_vector("q", q, self.kinematics.dof)[None], time_s)[0]
        if not pin.computeCollisions(self._model, self._data, self._shapes, self._results, state, True):
            return None
        hit = next(i for i, result in enumerate(self._results.collisionResults) if result.isCollision())
        return Contact(*self._pair(hit))

    def clearance(self, q: ArrayLike, time_s: float = 0.0, *, to: Literal["all", "obstacles"] = "all") -> Clearance:
        """The least distance between any two bodies at joints (dof,), or between the arm and obstacles only.

        Raises:
            MotionError: NaN, another number of joints, or there is nothing to be far from.
        """
        first_pair = 0 if one_of("clearance to", to, ("all", "obstacles")) == "all" else self._self_pairs_n
        if first_pair == self.pairs_n:
            raise MotionError("there is nothing that the arm could touch; give obstacles.")
        state = self._states(joint_vector("q", q, self.kinematics.dof)[None], time_s)[0]
        pin.computeDistances(self._model, self._data, self._shapes, self._results, state)
        gaps = [result.min_distance for result in self._results.distanceResults][first_pair:]
        nearest = int(np.argmin(gaps))
        return Clearance(float(gaps[nearest]), *self._pair(first_pair + nearest))

    def first_contact(
        self, trajectory: Trajectory, period_s: float = 0.02, from_s: float = 0.0
    ) -> tuple[float, Contact] | None:
        """When and between whom a trajectory first makes contact, with obstacles where they are then.

        Args:
            trajectory: Of the arm.
            period_s: Time between checks.
            from_s: Time of the world at which the trajectory starts.
        """
        times, state = trajectory.every(period_s)
        blocked = np.flatnonzero(~self.free(state.q, times + from_s))
        if not len(blocked):
            return None
        when = int(blocked[0])
        contact = self.contact(state.q[when], float(times[when] + from_s))
        return (float(times[when]), contact) if contact else None

    def _states(self, q: Array, times_s: ArrayLike) -> Array:
        """(n, nq) configurations of the model: joints, then each moving obstacle's position and quaternion."""
        if not self._moving:
            return q
        times = np.broadcast_to(np.asarray(times_s, float), len(q))
        columns = [q]
        for obstacle in self._moving:
            poses = obstacle.poses(times)
            columns.append(np.array([pin.SE3ToXYZQUAT(pin.SE3(T)) for T in poses]))
        return np.hstack(columns)

    def _collide(self, states: Array, stop_early: bool) -> Flags:
        if not self.pairs_n:
            return np.zeros(len(states), bool)
        if self._pool is None:
            self._pool = pin.TreeBroadPhaseManagerPool_DynamicAABBTreeCollisionManager(self._model, self._shapes, 1)
        columns = np.asfortranarray(states.T)
        return np.asarray(pin.computeCollisionsInParallel(1, self._pool, columns, True, stop_early), bool)

    def _pair(self, index: int) -> tuple[str, str]:
        pair = self._shapes.collisionPairs[index]
        return self._names[pair.first], self._names[pair.second]
