"""The planner of the thesis, its Algorithm 1: predict, rank, plan, and approach blindly once near enough.

Constants are those of the thesis and of the implementation that was published with it. Ours differs where that
implementation gains from a simulator: its arm jumps onto the first waypoint of the approach, and its speeds jump when a
plan replaces another; here both are made up for as fast as the limits allow (``GrasperCfg.approach_limits`` for the
former). Its fingers close in 0.2 s; here the hand goes along for as long as closing takes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tr_grasp.dynamic.attempt import CYCLE_S, Run
from tr_grasp.dynamic.meeting import HALF_TURN
from tr_grasp.dynamic.method import GraspOutcome, Phase
from tr_grasp.dynamic.step_out import step_out
from tr_grasp.dynamic.target import Forecast
from tr_grasp.dynamic.tool_path import BLENDS_S, entered, moved_along_tool
from tr_grasp.grasps.ranking import rank_grasps
from tr_grasp.motion import (
    JointState,
    Outcome,
    Plan,
    Planner,
    PlannerCfg,
    Trajectory,
    inverse_kinematics,
    time_optimal,
)

Array = NDArray[np.floating]
Ending = tuple[GraspOutcome, str]

FAR_M, NEAR_M = 0.3, 0.1
HORIZON_FAR_S, HORIZON_MIDDLE_S, HORIZON_NEAR_S = 2.0, 1.0, 0.0
GRASP_WITHIN = 1.1
"""Times the back-off: how near the hand must be to the grasp to approach."""
GRASP_WITHIN_RAD, JOINTS_WITHIN_RAD = np.deg2rad(20.0), 0.1
APPROACH_S, CLOSE_S = 1.0, 0.2
ALONG_S, TURN_S = 1.0, 0.3
"""For how long the hand goes along from the grasp on, and how long before it the joints begin to change their speed."""
JOINED_S = tuple(blend_s for blend_s in BLENDS_S if blend_s < APPROACH_S)
JUMP_RAD = 2.0
MOST_N = 10
PLANNER = PlannerCfg(time_limit_s=0.5)
PLANNING_AHEAD_S = 0.14
"""Planning is expected to take so long: a plan begins where the one before it will be by then."""


class Algorithm1:
    """Plans to where the object will be in two, one or no seconds, by the distance of the hand; one grasp at a time.

    Args:
        run: Of which this is the planner.
    """

    follows_while_closing = False
    """Its approach goes on by itself."""

    def __init__(self, run: Run) -> None:
        self.run, self.cfg = run, run.cfg
        self._planner = Planner(run.scene.way, PLANNER)
        self._plan: Plan | None = None
        self._q_pre: Array | None = None
        self._T_obj_tcp: Array | None = None
        self._number: int | None = None
        self._forecast: Forecast | None = None

    def reach(self) -> Ending | None:
        """Come to where the approach ends and the fingers close; or why that is not to be."""
        run = self.run
        run.tell(Phase.REACHING)
        while True:
            run.target.look(run.world)
            if lost := run.lost():
                return GraspOutcome.LOST, lost
            if run.path_is_over():
                return GraspOutcome.PATH_FINISHED, ""
            if not run.target.is_known:
                run.world.wait(CYCLE_S)
                continue
            before_s = run.now_s
            self._loop()
            if run.now_s == before_s:
                run.world.wait(CYCLE_S)  # where thinking costs nothing, the world must go on all the same
            if self._can_grasp() and self._approach():
                return None

    def grasp(self) -> tuple[Forecast, Array]:
        """The forecast of the approach, and ``T_obj_tcp`` of the grasp."""
        assert self._forecast is not None
        assert self._T_obj_tcp is not None
        return self._forecast, self._T_obj_tcp

    def failed(self) -> None:
        """The grasp did not hold."""
        self._plan = self._q_pre = None

    def horizon_s(self) -> float:
        """How far ahead the object is looked for, by the distance of the hand to the pre-grasp that it goes to."""
        if not self.cfg.look_ahead:
            return 0.0
        if self._q_pre is None:
            return HORIZON_FAR_S
        kinematics = self.run.kinematics
        ways = kinematics.pose(np.stack([self.run.arm.state().q_rad, self._q_pre]))[:, :3, 3]
        distance = float(np.linalg.norm(ways[0] - ways[1]))
        if distance > FAR_M:
            return HORIZON_FAR_S
        return HORIZON_MIDDLE_S if distance > NEAR_M else HORIZON_NEAR_S

    def _loop(self) -> None:
        run = self.run
        run.loops += 1
        run.target.look(run.world)
        horizon = self.horizon_s()
        seen_s = run.target.seen_s
        assert seen_s is not None
        # As published, from the last reading on: its age is not made up for.
        forecast = run.target.forecast(seen_s, seen_s + horizon + 2.0)
        self._forecast = forecast
        run.scene.expect(forecast)
        when_s = seen_s + horizon
        q_now = run.arm.commanded().q
        with run.thinking("ranking"):
            chosen = self._ranked(forecast, when_s, q_now)
        with run.thinking("inverse_kinematics", 2 * len(chosen)):
            self._choose(chosen, forecast, when_s, q_now)
        run.notes["ik_calls"] += 2 * len(chosen)
        if self._q_pre is not None:
            self._go(self._q_pre, when_s)

    def _ranked(self, forecast: Forecast, when_s: float, q: Array) -> NDArray[np.integer]:
        run, cfg = self.run, self.cfg
        if self._number is not None and not cfg.switching and self._q_pre is not None:
            return np.array([self._number])
        T, aids = forecast.poses(np.array([when_s]))[0], run.aids(forecast, when_s)
        return rank_grasps(run.kinematics, run.task.grasps, T, q, cfg.ranking, cfg.back_off_m, aids)[:MOST_N]

    def _choose(self, chosen: NDArray[np.integer], forecast: Forecast, when_s: float, q_now: Array) -> None:
        """The grasp whose postures at pre-grasp and grasp are nearest in joint space, among those that are free."""
        run = self.run
        if not len(chosen):
            return
        T_obj_tcp = run.task.grasps.grasps.poses()[chosen]
        T_obj_tcp = np.concatenate([T_obj_tcp, T_obj_tcp @ HALF_TURN])
        number = np.tile(chosen, 2)
        T = forecast.poses(np.array([when_s]))[0] @ T_obj_tcp
        pre = inverse_kinematics(run.kinematics, moved_along_tool(T, self.cfg.back_off_m), q_now).q_rad
        at = inverse_kinematics(run.kinematics, T, np.where(np.isfinite(pre), pre, q_now)).q_rad
        ok = np.asarray(np.isfinite(pre).all(-1) & np.isfinite(at).all(-1))
        times = np.full(int(ok.sum()), when_s)
        if ok.any():
            ok[ok] = run.scene.way.free(pre[ok], times) & run.scene.grasp.free(at[ok], times)
        if not ok.any():
            return
        way = np.linalg.norm(pre - q_now, axis=1) + np.linalg.norm(at - q_now, axis=1)
        i = int(np.argmin(np.where(ok, way, np.inf)))
        if self._number is not None and number[i] != self._number:
            run.switches += 1
        self._number, self._q_pre, self._T_obj_tcp = int(number[i]), pre[i], T_obj_tcp[i]

    def _go(self, q: Array, when_s: float) -> None:
        """Plan to the pre-grasp; if that fails, the plan before it goes on."""
        run = self.run
        start_s = run.now_s + max(PLANNING_AHEAD_S, run.lead_s())
        start = run.arm.commanded(start_s)
        with run.thinking("planning"):
            run.notes["planner_calls"] += 1
            plan = self._planned(start.q, q, when_s)
            if plan.path is None:
                return
            way = self._timed(plan.path, start)
        if way is not None and run.send(way, start_s):
            self._plan = plan

    def _planned(self, start_q: Array, q: Array, when_s: float) -> Plan:
        """A path; where the start touches something by then, with a step out of it at first, as MoveIt does."""
        previous = self._plan if self.cfg.seeding else None
        plan = self._planner.plan(start_q, q, previous=previous, time_s=when_s)
        if plan.outcome is not Outcome.START_IN_COLLISION:
            return plan
        out = step_out(self.run.scene.way, self.run.limits, start_q, when_s, self.run.rng)
        if out is None:
            return plan
        plan = self._planner.plan(out, q, previous=previous, time_s=when_s)
        return plan if plan.path is None else replace(plan, path=np.vstack([start_q, plan.path]))

    def _timed(self, path: Array, start: JointState) -> Trajectory | None:
        """The path in time, from what is left of the arm's speed along it; what is not along it vanishes quickly."""
        limits, ahead = self.run.limits, path[min(1, len(path) - 1)] - path[0]
        length = float(np.linalg.norm(ahead))
        along = max(float(start.dq @ ahead) / length, 0.0) * ahead / length if length > 0 else 0 * ahead
        for speed in (along, 0.5 * along, None) if self.cfg.seeding else (None,):
            way = time_optimal(path, limits, start_speed_rad_s=speed).trajectory
            joined = None if way is None else entered(way, start, self.run.arm.limits)
            if joined is not None:
                return joined
        return None

    def _can_grasp(self) -> bool:
        run = self.run
        if self._q_pre is None or self._T_obj_tcp is None:
            return False
        off_m, off_rad = run.tool_error(run.target.last_pose @ self._T_obj_tcp)
        near = off_m <= GRASP_WITHIN * self.cfg.back_off_m and off_rad <= GRASP_WITHIN_RAD
        return near or bool(np.abs(run.arm.state().q_rad - self._q_pre).max() < JOINTS_WITHIN_RAD)

    def _approach(self) -> bool:
        """Onto the line from the pre-grasp to where the grasp will be in a second, and on with the object.

        False if that cannot be, or would take another posture.
        """
        run = self.run
        assert self._T_obj_tcp is not None
        assert run.target.seen_s is not None
        start_s, seen_s = run.now_s, run.target.seen_s
        start = run.arm.commanded(start_s)
        forecast = run.target.forecast(seen_s, seen_s + APPROACH_S + ALONG_S)
        T = forecast.poses(seen_s + np.array([0.0, APPROACH_S, APPROACH_S + CLOSE_S])) @ self._T_obj_tcp
        T[0] = moved_along_tool(T[0], self.cfg.back_off_m)
        q = inverse_kinematics(run.kinematics, T, start.q).q_rad
        if not np.isfinite(q).all() or np.abs(q - start.q).max() > JUMP_RAD:
            return False
        forward, along = (q[1] - q[0]) / APPROACH_S, (q[2] - q[1]) / CLOSE_S
        times_s = np.array([0.0, APPROACH_S - TURN_S, APPROACH_S, APPROACH_S + ALONG_S])
        rows = np.stack([q[0], q[1] - TURN_S * forward, q[1], q[1] + ALONG_S * along])
        line = Trajectory(times_s, rows, np.stack([forward, forward, along, along]))
        path = entered(line, start, run.near_limits, JOINED_S)
        if path is None or not run.send(path, start_s):
            return False
        self._forecast = forecast
        run.tell(Phase.APPROACHING)
        run.world.wait(APPROACH_S)
        return True
