"""Policy steps executed as planned motions, as the thesis did with MoveIt."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from tr_grasp.motion import (
    CollisionModel,
    JointState,
    Kinematics,
    MotionLimits,
    Plan,
    Planner,
    PlannerCfg,
    Trajectory,
    box,
    point_to_point,
    time_optimal,
)
from tr_grasp.robots.agents import CartesianController, CartesianControllerConfig
from tr_grasp.robots.spec import robot_spec

SEARCH = PlannerCfg(rounds_n=750, time_limit_s=20.0)
"""The thesis allowed RRT-Connect 0.1 s; rounds instead, about as many, so that no outcome depends on the machine."""
TABLE_TOP_M = -0.002
"""A little under the real one: fingertips that rest on the table are no collision."""
STILL_RAD_S = 1e-3


class PlannedController(CartesianController):
    """Each step is a joint motion that touches neither the arm itself nor the table, timed by the arm's limits.

    Without a plan the arm comes to rest, and nothing is said about it; the next step supersedes what is not finished.

    Attributes:
        plan: Of the last step; nothing after a reset.
    """

    config: PlannedControllerConfig
    plan: Plan | None

    def reset(self) -> None:
        """As the Cartesian controller; nothing is planned."""
        super().reset()
        model = _collision_model(self.config.robot)
        self._limits = MotionLimits.of(model.kinematics.spec)
        self._planner, self.plan = Planner(model, SEARCH), None
        self._motion = Trajectory.resting(self._q)

    def set_action(self, action: ArrayLike) -> None:
        """Plan the motion of one policy step, (1, 5) or (5,)."""
        moving = self._motion.sample(self._substep * self.config.timestep_s)
        start = JointState(self._q, moving.dq, moving.ddq)
        before = self.target
        super().set_action(action)
        self.plan = self._planner.plan(start.q, self._q)
        motion = self._timed(self.plan, start)
        if motion is None:
            motion, self.target = _braking(start, self._limits), before
        self._motion, self._q = motion, start.q

    def before_simulation_step(self) -> None:
        """Send the drives their next targets."""
        self._drive_fingers()
        if self._substep >= self.config.substeps_n:
            return
        self._substep += 1
        told = self._motion.sample(self._substep * self.config.timestep_s)
        q, velocity = self._with_retreat(told.q, told.dq)
        self._q = np.clip(q, self._lower, self._upper)
        self._drive_arm(self._q, velocity)

    def _timed(self, plan: Plan, start: JointState) -> Trajectory | None:
        """The fastest motion along a plan from a state that may be one of motion; nothing where there is none."""
        if plan.path is None:
            return None
        speed = np.where(np.abs(start.dq) > STILL_RAD_S, start.dq, 0.0)
        timing = time_optimal(plan.path, self._limits, start_speed_rad_s=speed)
        if timing.trajectory is None and len(plan.path) == 2:
            timing = point_to_point(start, JointState.at_rest(plan.path[-1]), self._limits)
        motion = timing.trajectory
        # A motion that starts with a speed leaves the plan.
        if motion is not None and speed.any() and self._planner.model.first_contact(motion) is not None:
            return None
        return motion


def _braking(start: JointState, limits: MotionLimits) -> Trajectory:
    """From a state to rest, on a straight line of the joints."""
    duration = float((np.abs(start.dq) / limits.acceleration_rad_s2).max())
    if duration < STILL_RAD_S:
        return Trajectory.resting(start.q)
    return Trajectory(
        np.array([0.0, duration]),
        np.stack([start.q, start.q + start.dq * duration / 2]),
        np.stack([start.dq, np.zeros_like(start.dq)]),
    )


@lru_cache(maxsize=4)
def _collision_model(robot: str) -> CollisionModel:
    """The arm with open fingers over the table."""
    T = np.eye(4)
    T[2, 3] = TABLE_TOP_M - 0.05
    return CollisionModel(Kinematics(robot_spec(robot)), [box("table", (2.0, 2.0, 0.1), T)])


@dataclass
class PlannedControllerConfig(CartesianControllerConfig):
    """Settings of :class:`PlannedController`; ``robot`` is its name or YAML file."""

    robot: str = ""
    controller_cls = PlannedController
