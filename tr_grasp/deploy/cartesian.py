"""A policy's action as a motion of the arm: the next tool pose, its joints, and set-points or a plan to get there."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from tr_grasp.configs import EnvCfg
from tr_grasp.geometry import transform_from
from tr_grasp.hardware import Command, Station, finish
from tr_grasp.motion import CollisionModel, Kinematics, Planner, Servo, box, time_optimal
from tr_grasp.robots import ChainKinematics, RobotSpec
from tr_grasp.robots.cartesian import ToolLimits, ToolTarget, inverse_kinematics, next_target, pose_of

Array = NDArray[np.floating]
Execution = Literal["stepped", "smooth", "planned"]
SERVO_HZ = 100.0
STOP_MARGIN_RAD = 0.02
SPEED_SHARE = 0.98
SETTLE_TICKS = 200
FINGERS_S = 5.0
NEAR_RAD = 1e-3
TABLE_M = (2.0, 2.0, 0.1)
TABLE_TOP_M = -0.002


class CartesianSteps:
    """Moves the tool of a station in the steps of Task I.

    ``stepped`` streams what the simulated controller sends, a constant joint speed within each step; ``smooth`` goes
    to the end of each step as fast as limited acceleration and jerk allow, as a real arm needs it; ``planned`` plans
    every step as a collision-free motion, as the thesis did. A step whose joints are faster than the arm takes longer.

    Args:
        cfg: The task.
        spec: The robot.
        station: Its devices.
        execution: How.
    """

    def __init__(self, cfg: EnvCfg, spec: RobotSpec, station: Station, execution: Execution = "stepped") -> None:
        self.cfg, self.spec, self.station, self.execution = cfg, spec, station, execution
        self._chain = ChainKinematics(spec)
        self._R_home = self._chain.pose(np.array(spec.home_q_rad))[:3, :3]
        self._rest = np.array(spec.home_q_rad) if len(spec.joints) > 6 else None
        half, (x, y, _), (low, high) = cfg.workspace.side_m / 2, cfg.workspace.centre_m, cfg.workspace.tcp_height_m
        self._limits = ToolLimits(np.array([x - half, y - half, low]), np.array([x + half, y + half, high]))
        self._speeds = SPEED_SHARE * station.arm.limits.velocity_rad_s
        self._q = np.asarray(station.arm.commanded().q, float)
        self._servo = Servo(station.arm.limits, 1 / SERVO_HZ)
        self._servo.start(self._q)
        if execution == "planned":
            table = box("table", TABLE_M, transform_from(np.eye(3), (0.0, 0.0, TABLE_TOP_M - TABLE_M[2] / 2)))
            self._planner = Planner(CollisionModel(Kinematics(spec), [table]))
        T = self.tool_pose()
        R = T[:3, :3] @ self._R_home.T
        self.target = ToolTarget(T[:3, 3], float(np.arctan2(R[1, 0], R[0, 0])))
        self.closing = False

    def tool_pose(self) -> Array:
        """``T_base_tcp`` (4, 4) measured, with the fingertips where linkages have moved them."""
        T = self._chain.pose(np.asarray(self.station.arm.state().q_rad, float))
        T[:3, 3] += self._reach_m() * T[:3, 2]
        return T

    def proprioception(self) -> NDArray[np.float32]:
        """(10,) gripper reading, tcp position [m], first two columns of R_base_tcp."""
        if self.cfg.observation.gripper_reading == "measured":
            widest = self.spec.gripper.opening_range_m[1]
            gripper = 2.0 * self.station.gripper.state().opening_m / widest - 1.0
        else:
            gripper = -1.0 if self.closing else 1.0
        T = self.tool_pose()
        return np.array([gripper, *T[:3, 3], *T[:3, 0], *T[:3, 1]], np.float32)

    def step(self, action: Array) -> str:
        """Carry one action (5,) out; why that failed, empty if it did not."""
        a = np.clip(np.asarray(action, float).reshape(5), -1.0, 1.0)
        act = self.cfg.action
        fingers = self._move_fingers(a[4])
        self.target = next_target(
            self.target, self.tool_pose()[:3, 3], a[:3] * act.translation_step_m, a[3] * act.yaw_step_rad, self._limits
        )
        goal = pose_of(self.target, self._R_home)
        goal[:3, 3] -= self._reach_m() * goal[:3, 2]
        own = self.station.arm.limits
        q = inverse_kinematics(
            self._chain,
            goal,
            self._q,
            own.lower_rad + STOP_MARGIN_RAD,
            own.upper_rad - STOP_MARGIN_RAD,
            rest=self._rest,
        )
        start, self._q = self._q, q
        reason = self._planned(start, q) if self.execution == "planned" else self._streamed(start, q)
        return reason or self._await(fingers)

    def _move_fingers(self, wish: float) -> Command | None:
        if abs(wish) <= self.cfg.action.gripper_dead_zone or (closing := bool(wish < 0)) == self.closing:
            return None
        self.closing = closing
        low, high = self.station.gripper.opening_range_m
        return self.station.gripper.move(max(low, 0.0) if closing else high)

    def _await(self, fingers: Command | None) -> str:
        """Simulated fingers of Task I are through within a step; others take longer, so the arm holds on for them."""
        until = self.station.world.now_s + FINGERS_S
        while fingers is not None and not fingers.done:
            if self.station.world.now_s > until:
                return f"gripper: the fingers have not come to rest within {FINGERS_S:g} s"
            if self.execution != "planned" and (reason := self._told(self._q, np.zeros_like(self._q), self._q)):
                return reason
            self.station.world.wait(1 / SERVO_HZ)
        result = None if fingers is None else fingers.result
        return "" if result is None or result.succeeded else f"gripper: {result.reason}"

    def _streamed(self, start: Array, goal: Array) -> str:
        step_s = max(1.0 / self.cfg.control_hz, float((np.abs(goal - start) / self._speeds).max()))
        ticks_n = max(1, round(step_s * SERVO_HZ))
        speed = (goal - start) * SERVO_HZ / ticks_n
        for k in range(ticks_n + SETTLE_TICKS):
            if k >= ticks_n and self._is_at(goal):
                break
            # In Task I the drive's target runs ahead by a tick and stops with the step.
            share = min(k / ticks_n, 1.0)
            if reason := self._told(start + (goal - start) * share, speed * (k < ticks_n), goal):
                return reason
            self.station.world.wait(1 / SERVO_HZ)
        return self._told(goal, np.zeros_like(goal), goal)

    def _is_at(self, goal: Array) -> bool:
        """Whether what is commanded has reached the end of the step."""
        return self.execution == "stepped" or bool(np.abs(self._servo.state.q - goal).max() < NEAR_RAD)

    def _told(self, q: Array, dq: Array, goal: Array) -> str:
        """One set-point: the one given, or the next one of the fastest smooth motion to the goal."""
        if self.execution == "smooth":
            told = self._servo.reach(goal)
            q, dq = told.q, told.dq
        result = self.station.arm.servo(q, dq).result
        return "" if result is None else f"arm: {result.reason}"

    def _planned(self, start: Array, goal: Array) -> str:
        start = np.asarray(self.station.arm.commanded().q, float)
        plan = self._planner.plan(start, goal)
        if plan.path is None:
            self._q = start
            return ""  # as in the environment, the arm stays and the policy sees it
        timing = time_optimal(plan.path, self.station.arm.limits.scaled(SPEED_SHARE))
        if timing.trajectory is None:
            return f"arm: {timing.reason}"
        result = finish(self.station.arm.move(timing.trajectory), self.station.world)
        return "" if result.succeeded else f"arm: {result.reason}"

    def _reach_m(self) -> float:
        gripper = self.spec.gripper
        return gripper.tips_beyond_tcp_m(self.station.gripper.state().opening_m) - gripper.tips_m[0]
