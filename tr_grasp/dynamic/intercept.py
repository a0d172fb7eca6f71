"""Where and when to meet a moving object: a search over grasps, arrival times and postures of the arm."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tr_grasp.dynamic.course import FEW, JUMP_RAD, MANY, Course
from tr_grasp.dynamic.meeting import Candidates, Found, Meeting
from tr_grasp.dynamic.reach_time import least_time, turning_time
from tr_grasp.dynamic.scene import Scene
from tr_grasp.dynamic.target import Forecast
from tr_grasp.dynamic.tool_path import moved_along_tool
from tr_grasp.motion import IKCfg, JointState, MotionLimits, Trajectory, inverse_kinematics, point_to_point

Array = NDArray[np.floating]

LEADS_N = 12
SHORTLIST_N, REFINED_N = 128, 4
MARGIN_S = 0.05
ROUNDS_N, SETTLED_S, FURTHER = 10, 0.02, 1.5
"""How often an arrival is guessed, how exactly, and how much further than by its delay if it was too soon."""
PUNCTUAL_S, ON_COURSE_RAD = 0.002, 0.01
"""So much later than planned is on time, and so far off is what following corrects."""
RESERVE, WORTHWHILE = 0.05, 0.1
"""Share of the limits that is kept for corrections, and of the time ahead that an earlier arrival must gain."""
NORMAL_95 = 1.645
CLEARANCE_M = 0.04
"""How far off a forecast may be at the pre-grasp (95 %) without a delay: re-planning corrects it."""
CORRECTION_M_S = 0.15
"""Speed at which the arm is taken to correct what is further off."""
EASE_S = 1.0
"""What a nearly singular posture costs compared to time."""
HALF_TURNS_LOST = 0.7
"""A grasp that does not hold costs another attempt: so many half turns of a joint."""
EASY = 0.03
LEVER_PER_M = 10.0
"""Risk that it does not hold, for its distance from the centre of mass: what swings there creeps out of two pads."""
_NEAR = IKCfg(rounds_n=0)


class InterceptSearch:
    """Looks for meetings.

    Args:
        scene: The arm among obstacles; it expects the forecasts that are passed.
        limits: Of the arm.
        candidates: Grasps.
        back_off_m: Distance of the pre-grasp.
        horizon_s: Latest arrival.
        approach_s: Time from pre-grasp to grasp.
        lift_m: How far up the hand goes with the object.
    """

    def __init__(
        self,
        scene: Scene,
        limits: MotionLimits,
        candidates: Candidates,
        back_off_m: float,
        horizon_s: float,
        approach_s: float,
        lift_m: float,
    ) -> None:
        self.scene, self.limits, self.candidates = scene, limits, candidates
        self.kinematics, self.back_off_m = scene.kinematics, back_off_m
        self.horizon_s = horizon_s
        self.course = Course(scene, back_off_m, approach_s, lift_m)
        self._half = len(candidates) // 2
        self._T_obj_pre = moved_along_tool(candidates.T_obj_tcp, back_off_m)
        self._leads = np.geomspace(0.04 * horizon_s, horizon_s, LEADS_N)
        attempt_s = HALF_TURNS_LOST * turning_time(np.pi, limits)
        self._unsure_s = attempt_s * (1 - candidates.worth + LEVER_PER_M * candidates.lever_m)
        self._calm = limits.scaled(1 - RESERVE)
        # A motion with limited jerk takes about so much longer than its lower bound.
        self._jerk_s = float((limits.acceleration_rad_s2 / limits.jerk_rad_s3).max())

    def search(self, forecast: Forecast, start: JointState, start_s: float) -> Found:
        """The best meeting from a state of the arm at a time, over all grasps, times and postures."""
        k, m, leads = LEADS_N, self._half, self._leads
        T_obj = forecast.poses(start_s + leads)
        T_pre = T_obj[:, None] @ self._T_obj_pre[None, :m]
        found = inverse_kinematics(self.kinematics, T_pre.reshape(-1, 4, 4), start.q).postures_rad
        q = found.reshape(k, m, -1, start.q.size)
        q = np.concatenate([q, self._turned(q, start.q)], axis=1)  # (k, 2m, branches, dof)
        bound = least_time(start, q, np.zeros_like(start.q), self._calm)
        reachable = np.isfinite(bound)
        arrival = self._arrivals(bound)
        in_time = np.isfinite(arrival)
        cost = self._costs(forecast, start_s, arrival, q, slice(None))
        # Of each grasp and posture the cheapest time; of those the cheapest.
        best_k = cost.argmin(0)
        cheapest = np.take_along_axis(cost, best_k[None], 0)[0]
        order = np.argsort(cheapest, axis=None)[:SHORTLIST_N]
        order = order[np.isfinite(cheapest.ravel()[order])]
        c, b = np.unravel_index(order, cheapest.shape)
        t = best_k[c, b]
        postures, times = q[t, c, b], start_s + leads[t]
        free = self.scene.way.free(postures, times) if len(c) else np.zeros(0, bool)
        T = self.candidates.T_obj_tcp[c[free]]
        free[free] = self.course.is_free(forecast, T, postures[free], times[free], FEW)
        counts = int(reachable.sum()), int(in_time.sum()), int(free.sum())
        meetings, blocked = [], []
        for i in np.flatnonzero(free):
            if len(meetings) + len(blocked) >= REFINED_N:
                break
            meeting = self.refined(forecast, start, start_s, int(c[i]), postures[i], float(times[i]))
            if meeting is not None:
                meetings.append(meeting)
            elif self.can_go_on(forecast, int(c[i]), postures[i], float(times[i])):
                blocked.append((int(c[i]), postures[i], float(times[i])))
        best = min(meetings, key=lambda meeting: meeting.cost_s, default=None)
        return Found(*counts, best, tuple(blocked))

    def again(self, forecast: Forecast, start: JointState, start_s: float, meeting: Meeting) -> Meeting | None:
        """The direct motion from a later state to what the arm is after: at the same time, or clearly sooner if it can.

        All of the limits are used last: an arm that did so from the start could not brake in time where the object
        turns out to be a little nearer, and would have to come back.
        """
        at = start_s, meeting.candidate, meeting.q, meeting.arrival_s
        kept = (
            self._met(forecast, start, *at, self._calm)
            or self._on_course(forecast, start_s, meeting)
            or self._met(forecast, start, *at, self.limits)
        )
        if kept is not None:
            gain_s = meeting.arrival_s - self._least_s(start, start_s, kept.q)
            if gain_s < WORTHWHILE * (meeting.arrival_s - start_s):
                return kept
        sooner = self.refined(forecast, start, start_s, meeting.candidate, meeting.q, meeting.arrival_s)
        found = [one for one in (kept, sooner) if one is not None]
        return min(found, key=lambda one: one.arrival_s, default=None)

    def refined(
        self, forecast: Forecast, start: JointState, start_s: float, candidate: int, q: Array, arrival_s: float
    ) -> Meeting | None:
        """The direct motion that meets a candidate as early as possible, near a posture, or nothing if it is blocked.

        It arrives at the first time at which the arm can be where the candidate will be then, with some reserve.
        """
        late_s, in_time_s, aim_s = start_s, np.inf, self._least_s(start, start_s, q)
        for _ in range(ROUNDS_N):
            duration_s = self._duration_s(forecast, start, candidate, q, aim_s)
            if not np.isfinite(duration_s):
                break
            over_s = start_s + duration_s - aim_s
            late_s, in_time_s = (aim_s, in_time_s) if over_s > 0 else (late_s, aim_s)
            if over_s <= 0 and min(-over_s, in_time_s - late_s) < SETTLED_S:
                break
            is_bracketed = np.isfinite(in_time_s)
            aim_s = (late_s + in_time_s) / 2 if is_bracketed else aim_s + FURTHER * over_s + SETTLED_S
        if np.isfinite(in_time_s):
            met = self._met(forecast, start, start_s, candidate, q, in_time_s, self._calm)
            if met is not None:
                return met
        # Too far now, or never in time: be there at rest when the object comes.
        goal = self.goal(forecast, candidate, q, arrival_s)
        timing = None if goal is None else point_to_point(start, JointState.at_rest(goal.q), self.limits)
        if goal is None or timing is None or timing.trajectory is None:
            return None
        way = timing.trajectory
        return self._free(forecast, candidate, goal.q, start_s, max(arrival_s, start_s + way.duration_s), way)

    def _least_s(self, start: JointState, start_s: float, q: Array) -> float:
        """When the arm can be at joints at the earliest, or little later."""
        return start_s + self._jerk_s + float(least_time(start, q, np.zeros_like(q), self._calm))

    def _duration_s(self, forecast: Forecast, start: JointState, candidate: int, q: Array, aim_s: float) -> float:
        """How long the arm needs to where a candidate will be at a time; infinite if it cannot get there."""
        goal = self.goal(forecast, candidate, q, aim_s)
        way = None if goal is None else point_to_point(start, goal, self._calm).trajectory
        return np.inf if way is None else way.duration_s

    def _on_course(self, forecast: Forecast, start_s: float, meeting: Meeting) -> Meeting | None:
        """The rest of the way that the arm is on, if it still leads to where the candidate will be."""
        gone_s = start_s - meeting.start_s
        goal = self.goal(forecast, meeting.candidate, meeting.q, meeting.arrival_s)
        if goal is None or not 0 <= gone_s < meeting.way.duration_s:
            return None
        if np.abs(goal.q - meeting.way.end.q).max() > ON_COURSE_RAD:
            return None
        rest = meeting.way.cut(gone_s)
        return self._free(forecast, meeting.candidate, meeting.q, start_s, meeting.arrival_s, rest)

    def _met(
        self,
        forecast: Forecast,
        start: JointState,
        start_s: float,
        candidate: int,
        q: Array,
        arrival_s: float,
        limits: MotionLimits,
    ) -> Meeting | None:
        """The direct motion that is at a candidate at a time, moving along with it; nothing if late or blocked."""
        goal = self.goal(forecast, candidate, q, arrival_s)
        if goal is None:
            return None
        lead_s = arrival_s - start_s
        way = point_to_point(start, goal, limits, at_least_s=lead_s).trajectory
        if way is None or way.duration_s > lead_s + PUNCTUAL_S:
            return None
        return self._free(forecast, candidate, goal.q, start_s, arrival_s, way)

    def _free(
        self, forecast: Forecast, candidate: int, q: Array, start_s: float, arrival_s: float, way: Trajectory
    ) -> Meeting | None:
        if not self.can_go_on(forecast, candidate, q, arrival_s) or not self.scene.is_free(way, start_s):
            return None
        return self.meeting(forecast, candidate, q, start_s, arrival_s, way)

    def meeting(
        self, forecast: Forecast, candidate: int, q: Array, start_s: float, arrival_s: float, way: Trajectory
    ) -> Meeting:
        """A way with what it costs."""
        lead = arrival_s - start_s
        row = self._costs(
            forecast, start_s, np.full((1, 1, 1), lead), q[None, None, None], slice(candidate, candidate + 1)
        )
        return Meeting(
            candidate, self.candidates.T_obj_tcp[candidate], int(self.candidates.number[candidate]),
            q, start_s, arrival_s, way, float(row[0, 0, 0]),
        )  # fmt: skip

    def goal(self, forecast: Forecast, candidate: int, near_q: Array, time_s: float) -> JointState | None:
        """Joints at the pre-grasp at a time, moving along with the object; nothing where that posture ends."""
        times = np.array([time_s, time_s + 0.1])
        T = forecast.poses(times) @ self._T_obj_pre[candidate]
        q = inverse_kinematics(self.kinematics, T, near_q, _NEAR).q_rad
        if not np.isfinite(q).all() or np.abs(q[1] - q[0]).max() > 0.2 or np.abs(q[0] - near_q).max() > JUMP_RAD:
            return None
        top = 0.9 * self.limits.velocity_rad_s
        speed = np.clip((q[1] - q[0]) / 0.1, -top, top)
        return JointState(q[0], speed, np.zeros_like(speed))

    def can_go_on(self, forecast: Forecast, candidate: int, q: Array, time_s: float) -> bool:
        """Whether everything from a posture at the pre-grasp on is free if the hand leaves it at a time."""
        T = self.candidates.T_obj_tcp[candidate][None]
        return bool(self.course.is_free(forecast, T, q[None], np.array([time_s]), MANY)[0])

    def _arrivals(self, bound: Array) -> Array:
        """(k, m, branches) [s] from the start when the arm would be there, infinite where it could not be in time.

        Between a time at which it would be late and the next one, at which it would not, it is just in time.
        """
        leads = self._leads[:, None, None]
        spare = leads - (bound + self._jerk_s + MARGIN_S)
        arrival = np.where(spare >= 0, leads, np.inf)
        arrival[0] -= np.maximum(spare[0], 0.0)
        turns = np.isfinite(spare[:-1]) & (spare[:-1] < 0) & (spare[1:] >= 0)
        share = spare[:-1][turns] / (spare[:-1][turns] - spare[1:][turns])
        early, late = (np.broadcast_to(x, turns.shape)[turns] for x in (leads[:-1], leads[1:]))
        arrival[1:][turns] = early + share * (late - early)
        return arrival

    def _costs(self, forecast: Forecast, start_s: float, arrival: Array, q: Array, chosen: slice) -> Array:
        """(k, m, branches) [s]: the arrival, and what an unsure forecast, grasp or posture adds to it."""
        # What cannot be in time need not be judged.
        finite = np.isfinite(arrival) & np.isfinite(q).all(-1)
        ease = np.zeros(finite.shape)
        ease[finite] = np.minimum(self.kinematics.manipulability(q[finite]) / EASY, 1.0)
        off = NORMAL_95 * forecast.sigma(start_s + arrival) - CLEARANCE_M
        delay = arrival + np.maximum(off, 0.0) / CORRECTION_M_S
        return delay + self._unsure_s[chosen][None, :, None] + EASE_S * (1 - ease)

    def _turned(self, q: Array, reference: Array) -> Array:
        """The same tool axis with the fingers the other way round: the last joint half a turn on, nearest to now."""
        turned = np.array(q)
        last = turned[..., -1] + np.pi
        lower, upper = self.limits.lower_rad[-1], self.limits.upper_rad[-1]
        last = reference[-1] + (last - reference[-1] + np.pi) % (2 * np.pi) - np.pi
        last = np.where(last > upper, last - 2 * np.pi, last)
        turned[..., -1] = np.where(last < lower, last + 2 * np.pi, last)
        return turned
