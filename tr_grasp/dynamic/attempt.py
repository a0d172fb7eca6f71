"""What both planners share: devices, knowledge, clocks and counters of one run, and what hands do at a grasp."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tr_grasp.configs.dynamic import Work
from tr_grasp.dynamic.charges import charged
from tr_grasp.dynamic.method import DynamicTask, GraspOutcome, MethodResult, Phase
from tr_grasp.dynamic.scene import Scene
from tr_grasp.dynamic.settings import GrasperCfg
from tr_grasp.dynamic.step_out import step_out
from tr_grasp.dynamic.target import Forecast, Target
from tr_grasp.dynamic.tool_path import ToolPoses, follow, moved_along_tool, shortest_allowed, smooth
from tr_grasp.grasps.ranking import NO_AIDS, RankingAids
from tr_grasp.hardware import Ending, Station
from tr_grasp.motion import JointState, Kinematics, MotionLimits, Trajectory, point_to_point
from tr_grasp.prediction.registry import make_predictor
from tr_grasp.robots import RobotSpec

Array = NDArray[np.floating]

CYCLE_S = 0.04
"""The arm gets a new plan this often, if thinking is quick enough: 25 Hz."""
FIRST_GUESS_S = {"loop": 0.03, "search": 0.07}
LEAD_FACTOR, LEAD_MARGIN_S, FORGETTING = 1.15, 0.01, 0.9
"""A plan begins so much later than thinking is expected to take, by the longest thought lately."""
EARLY_S = 1e-6
CLOSING_LIMIT_S = 2.0
LIFTS_S = (0.7, 1.0, 1.5, 2.5, 4.0, 6.0, 9.0)
EMPTY_M = 2e-3
"""Pads that are nearer than this hold nothing."""
RAISED_SHARE = 0.5
PATIENCE_S = 0.5


class Run:
    """One run of a method.

    Args:
        station: The devices.
        task: What is to be grasped, and where.
        cfg: Settings.
        aids: What the ranking knows beside the arm and the grasps.

    Raises:
        GraspError: No grasp of the task held as often as the settings ask for.
    """

    def __init__(self, station: Station, task: DynamicTask, cfg: GrasperCfg, aids: RankingAids = NO_AIDS) -> None:
        self._aids = aids
        self.station, self.cfg = station, cfg
        self.task = task = replace(task, grasps=task.grasps.held_at_least(cfg.least_held))
        self.arm, self.world = station.arm, station.world
        self.kinematics = _kinematics(task.robot)
        self.limits = MotionLimits.of(task.robot, cfg.limits)
        self.near_limits = MotionLimits.of(task.robot, cfg.approach_limits)
        self.target = Target(task.target, make_predictor(cfg.predictor, cfg.motion_class), cfg.look_ahead)
        self.scene = Scene.of(self.kinematics, task, self.arm.commanded().q, cfg.limits)
        self.rng = np.random.default_rng(task.seed)
        self.begun_s = self.world.now_s
        self.thinking_s = self.longest_s = 0.0
        self.attempts = self.loops = self.switches = 0
        self.committed_s: float | None = None
        self.notes: dict[str, float] = {"ik_calls": 0.0, "planner_calls": 0.0, "longest_loop_s": 0.0, "late_plans": 0.0}
        costs = task.charges
        self._expected_s = {kind: costs.cost_s("planning", guess) for kind, guess in FIRST_GUESS_S.items()}
        self._pending: tuple[Trajectory, float] | None = None
        self._is_thinking = self.was_late = False

    @property
    def now_s(self) -> float:
        """The world's clock."""
        return self.world.now_s

    def lead_s(self, kind: str = "loop") -> float:
        """How long after now a plan may begin that has yet to be thought of: ``loop`` or ``search``."""
        return LEAD_FACTOR * self._expected_s[kind] + LEAD_MARGIN_S

    @contextmanager
    def thinking(self, work: Work, calls_n: int = 1, kind: str = "loop") -> Iterator[None]:
        """What is computed inside costs time; what is sent inside goes out when that is over, if it is not too late."""
        self._pending, self._is_thinking, self.was_late = None, True, False
        try:
            with charged(self.world, self.task.charges, work, calls_n) as thought:
                yield
        finally:
            self._is_thinking = False
        self.thinking_s += thought.seconds
        if work == "planning":
            self._expected_s[kind] = max(thought.seconds, FORGETTING * self._expected_s[kind])
            self.notes["longest_loop_s"] = max(self.notes["longest_loop_s"], thought.seconds)
        self._send_pending()

    def _send_pending(self) -> None:
        if self._pending is not None:
            self.was_late = not self.send(*self._pending)
            self.notes["late_plans"] += self.was_late

    def aids(self, forecast: Forecast, time_s: float) -> RankingAids:
        """What the ranking knows, with the speed that the predictor expects at a time."""
        return replace(self._aids, velocity_base_mps=forecast.states(np.array([time_s]))[1][0])

    def tell(self, phase: Phase) -> None:
        """Say what goes on."""
        if phase is Phase.APPROACHING:
            self.committed_s = self.now_s - self.begun_s
        self.task.tell(phase)

    def lost(self) -> str:
        """Why the target counts as lost; empty if it does not."""
        seen = self.target.seen_s
        since = self.now_s - (self.begun_s if seen is None else seen)
        return f"no reading for {since:.1f} s" if since > self.cfg.lost_after_s else ""

    def path_is_over(self) -> bool:
        """The object has stopped, and the trial with it."""
        return self.task.path_end_s is not None and self.now_s >= self.task.path_end_s

    def result(self, outcome: GraspOutcome, detail: str = "", lifted_s: float | None = None) -> MethodResult:
        """What came of it."""
        return MethodResult(
            outcome, detail, self.committed_s, lifted_s, self.thinking_s, self.attempts, self.loops, self.switches,
            dict(self.notes),
        )  # fmt: skip

    def send(self, trajectory: Trajectory, at_s: float) -> bool:
        """Have the arm follow a trajectory from a time on; false if that is refused, for example because it is late."""
        if self._is_thinking:
            self._pending = (trajectory, at_s)
            return True
        if at_s < self.now_s - EARLY_S:
            return False
        command = self.arm.move(trajectory, at_s=at_s)
        return command.result is None or command.result.ending is not Ending.REFUSED

    def step_out(self, start: JointState, start_s: float) -> bool:
        """Get away from where the arm stands too near to something, and every way is blocked from its beginning.

        False if it stands free, or no way out was found.
        """
        if self.scene.way.contact(start.q, start_s) is None:
            return False
        out = step_out(self.scene.way, self.limits, start.q, start_s, self.rng)
        way = None if out is None else point_to_point(start, JointState.at_rest(out), self.limits).trajectory
        return way is not None and self.send(way, start_s)

    def tool_error(self, T_base_tcp: Array) -> tuple[float, float]:
        """How far [m] and how much turned [rad] the tool is from where it should be, as measured."""
        T = self.kinematics.pose(self.arm.state().q_rad)
        turn = np.arccos(np.clip((np.trace(T[:3, :3].T @ T_base_tcp[:3, :3]) - 1) / 2, -1.0, 1.0))
        return float(np.linalg.norm(T[:3, 3] - T_base_tcp[:3, 3])), float(turn)

    def go_along(self, tool_poses: ToolPoses, duration_s: float, near_q: Array | None = None) -> bool:
        """Follow a moving pose from now on."""
        start_s = self.now_s
        start = self.arm.commanded(start_s)
        path = follow(self.kinematics, self.near_limits, tool_poses, start, start_s, duration_s, near_q)
        return path is not None and self.send(path, start_s)

    def close(self, forecast: Forecast, T_obj_tcp: Array, goes_along: bool = True) -> bool:
        """Close the fingers while the hand goes along with the object; whether there is something between them.

        Without ``goes_along``, the hand goes on as it was told before. What is seen of the object while fingers push it
        is no news about its path, so the forecast stays as it was.
        """
        self.tell(Phase.CLOSING)
        self.attempts += 1
        if goes_along:
            self.go_along(lambda times: forecast.poses(times) @ T_obj_tcp, CLOSING_LIMIT_S + 0.5)
        gripper = self.station.gripper
        command, until = gripper.move(gripper.opening_range_m[0]), self.now_s + CLOSING_LIMIT_S
        while not command.done and self.now_s < until:
            self.world.wait(CYCLE_S / 2)
        return gripper.state().opening_m > EMPTY_M

    def lift(self) -> bool:
        """Take the hand straight up while what it moved along with runs out; whether the arm could."""
        self.tell(Phase.LIFTING)
        start_s = self.now_s
        start = self.arm.commanded(start_s)
        T, speed = self.kinematics.pose(start.q), self.kinematics.tcp_velocity(start.q, start.dq)[:3]

        def rising(lift_s: float) -> Trajectory | None:
            def poses(times_s: Array) -> Array:
                u = np.clip((times_s - start_s) / lift_s, 0.0, 1.0)
                # Braking evenly: half of the way that the speed would have gone.
                rows = np.tile(T, (len(u), 1, 1))
                rows[:, :3, 3] += lift_s * (u - u**2 / 2)[:, None] * speed
                rows[:, 2, 3] += self.task.lift_m * smooth(u)
                return rows

            return follow(self.kinematics, self.limits, poses, start, start_s, lift_s)

        path = shortest_allowed(rising, LIFTS_S)
        if path is None or not self.send(path, start_s):
            return False
        self.world.wait(path.duration_s + CYCLE_S)
        return True

    def is_held(self, before: Array) -> bool:
        """Whether the object, which was at ``T_base_obj`` (4, 4) before, has been seen to have risen with the hand."""
        since, until = self.now_s, self.now_s + PATIENCE_S
        while self.now_s < until and not self.world.poses(self.task.target, since):
            self.world.wait(CYCLE_S)
        seen = self.world.poses(self.task.target, since - 0.1)
        holds = self.station.gripper.state().opening_m > EMPTY_M
        risen = seen[-1].T_base_object[2, 3] - before[2, 3] if seen else 0.0
        return holds and (not seen or bool(risen > RAISED_SHARE * self.task.lift_m))

    def let_go(self, back_m: float) -> None:
        """Open the fingers and draw the hand back against its approach, along with the object, before another attempt.

        A hand that stayed behind would be pushed by an object that comes after it.
        """
        self.tell(Phase.REACHING)
        gripper = self.station.gripper
        command, until = gripper.move(gripper.opening_range_m[1]), self.now_s + CLOSING_LIMIT_S
        T = self.kinematics.pose(self.arm.commanded().q)
        self.target.look(self.world)
        start_s = self.now_s
        forecast = self.target.forecast(start_s, start_s + LIFTS_S[-1])
        T_obj_tcp = np.linalg.inv(forecast.poses(np.array([start_s]))[0]) @ T

        def back(duration_s: float) -> Trajectory | None:
            def poses(times_s: Array) -> Array:
                gone_m = back_m * smooth((times_s - start_s - 0.3) / (duration_s - 0.3))
                return moved_along_tool(forecast.poses(times_s) @ T_obj_tcp, gone_m)

            start = self.arm.commanded(start_s)
            return follow(self.kinematics, self.near_limits, poses, start, start_s, duration_s)

        if (path := shortest_allowed(back, LIFTS_S)) is not None:
            self.send(path, start_s)
            until = max(until, start_s + path.duration_s) if command.done else until
        while self.now_s < until and not (command.done and path is not None and self.now_s > start_s + path.duration_s):
            self.world.wait(CYCLE_S)


@lru_cache(maxsize=4)
def _kinematics(robot: RobotSpec) -> Kinematics:
    return Kinematics(robot)
