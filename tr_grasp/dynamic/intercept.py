"""Where and when to meet a moving object: a search over grasps, arrival times and postures of the arm."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tr_grasp.dynamic.course import FEW, JUMP_RAD, MANY, Course
from tr_grasp.dynamic.reach_time import least_time
from tr_grasp.dynamic.scene import Scene
from tr_grasp.dynamic.target import Forecast
from tr_grasp.dynamic.tool_path import moved_along_tool
from tr_grasp.grasps import GraspSet
from tr_grasp.motion import IKCfg, JointState, MotionLimits, Trajectory, inverse_kinematics, point_to_point

Array = NDArray[np.floating]
Index = NDArray[np.integer]

HALF_TURN = np.diag([-1.0, -1.0, 1.0, 1.0])
"""About the tool's z: the fingers change places."""
LEADS_N = 12
SHORTLIST_N, REFINED_N = 128, 4
RUCKIG_FACTOR, MARGIN_S = 1.15, 0.05
"""A motion with limited jerk takes about so much longer than its lower bound."""
NORMAL_95 = 1.645
CLEARANCE_M = 0.04
"""How far off a forecast may be at the pre-grasp (95 %) without a delay: re-planning corrects it."""
CORRECTION_M_S = 0.15
"""Speed at which the arm is taken to correct what is further off."""
ROBUSTNESS_S, EASE_S = 1.0, 1.0
"""What an unsure grasp, and a nearly singular posture, cost compared to time."""
EASY = 0.03
LEVER_S_M = 10.0
"""And one that holds the object off its centre of mass: what swings there turns between two pads, and creeps out."""
_NEAR = IKCfg(rounds_n=0)


@dataclass(frozen=True, eq=False)
class Candidates:
    """Grasps with the fingers either way round, best first.

    Attributes:
        T_obj_tcp: (m, 4, 4).
        worth: (m,) in [0, 1].
        number: (m,) which grasp of the set each is.
        lever_m: (m,) distance of the line along which the fingers close from the object's centre of mass.
    """

    T_obj_tcp: Array
    worth: Array
    number: Index
    lever_m: Array

    @classmethod
    def of(cls, grasps: GraspSet, chosen: Index) -> Candidates:
        """Those of the set that an index chooses."""
        T, worth = grasps.grasps.poses()[chosen], grasps.robustness[chosen]
        turned = T @ HALF_TURN
        lever = np.linalg.norm(np.cross(T[:, :3, 1], T[:, :3, 3]), axis=1)
        return cls(np.concatenate([T, turned]), np.tile(worth, 2), np.tile(chosen, 2), np.tile(lever, 2))

    def __len__(self) -> int:
        return len(self.worth)


@dataclass(frozen=True, eq=False)
class Meeting:
    """A grasp, the time at which the arm is at its pre-grasp, and the way there.

    Attributes:
        candidate: Which.
        T_obj_tcp: (4, 4) of the grasp.
        number: Which grasp of the set.
        q: (dof,) posture at the pre-grasp.
        start_s, arrival_s: Times of the world's clock.
        way: Trajectory between them.
        cost_s: Arrival and everything else that counts, from the start.
    """

    candidate: int
    T_obj_tcp: Array
    number: int
    q: Array
    start_s: float
    arrival_s: float
    way: Trajectory
    cost_s: float


@dataclass(frozen=True)
class Found:
    """What a search found: how many poses of (time, grasp) are within reach, in time, free; the best meeting if any."""

    reachable_n: int
    in_time_n: int
    free_n: int
    best: Meeting | None = None
    blocked: tuple[tuple[int, Array, float], ...] = ()
    """Candidate, posture, time of those that are free themselves, but not the direct way to them."""


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

    def search(self, forecast: Forecast, start: JointState, start_s: float) -> Found:
        """The best meeting from a state of the arm at a time, over all grasps, times and postures."""
        k, m, leads = LEADS_N, self._half, self._leads
        T_obj = forecast.poses(start_s + leads)
        T_pre = T_obj[:, None] @ self._T_obj_pre[None, :m]
        found = inverse_kinematics(self.kinematics, T_pre.reshape(-1, 4, 4), start.q).postures_rad
        q = found.reshape(k, m, -1, start.q.size)
        q = np.concatenate([q, self._turned(q, start.q)], axis=1)  # (k, 2m, branches, dof)
        bound = least_time(start, q, np.zeros_like(start.q), self.limits)
        reachable = np.isfinite(bound)
        in_time = RUCKIG_FACTOR * bound + MARGIN_S <= leads[:, None, None]
        cost = self._costs(forecast, start_s, leads, q, bound)
        cost[~in_time] = np.inf
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

    def refined(
        self, forecast: Forecast, start: JointState, start_s: float, candidate: int, q: Array, arrival_s: float
    ) -> Meeting | None:
        """The direct motion that meets a candidate as early as possible, near a posture, or nothing if it is blocked.

        The arrival is the fixed point of "aim at where it will be after the time that getting there takes".
        """
        way: Trajectory | None = None
        aim_s = start_s + float(RUCKIG_FACTOR * least_time(start, q, np.zeros_like(q), self.limits))
        for _ in range(5):
            goal = self.goal(forecast, candidate, q, aim_s)
            if goal is None:
                break
            timing = point_to_point(start, goal, self.limits)
            if timing.trajectory is None:
                return None
            way, q = timing.trajectory, goal.q
            if abs(start_s + way.duration_s - aim_s) < 0.01:
                break
            aim_s = start_s + way.duration_s
        else:
            way = None
        if way is None:  # too far now, or no fixed point: be there when the object comes
            goal = self.goal(forecast, candidate, q, arrival_s)
            timing = None if goal is None else point_to_point(start, JointState.at_rest(goal.q), self.limits)
            if goal is None or timing is None or timing.trajectory is None:
                return None
            way, q, aim_s = timing.trajectory, goal.q, max(arrival_s, start_s + timing.trajectory.duration_s)
        if not self.can_go_on(forecast, candidate, q, aim_s) or not self.scene.is_free(way, start_s):
            return None
        return self.meeting(forecast, candidate, q, start_s, aim_s, way)

    def meeting(
        self, forecast: Forecast, candidate: int, q: Array, start_s: float, arrival_s: float, way: Trajectory
    ) -> Meeting:
        """A way with what it costs."""
        lead = arrival_s - start_s
        row = self._costs(forecast, start_s, np.array([lead]), q[None, None, None], None, [candidate])
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

    def _costs(
        self,
        forecast: Forecast,
        start_s: float,
        leads: Array,
        q: Array,
        bound: Array | None,
        candidates: list[int] | None = None,
    ) -> Array:
        """(k, m, branches) [s]: the arrival, and what an unsure forecast, grasp or posture adds to it."""
        finite = np.isfinite(q).all(-1)
        ease = np.zeros(finite.shape)
        if bound is not None:  # what cannot be in time need not be judged
            finite &= RUCKIG_FACTOR * bound + MARGIN_S <= leads[:, None, None]
        ease[finite] = np.minimum(self.kinematics.manipulability(q[finite]) / EASY, 1.0)
        chosen = slice(None) if candidates is None else candidates
        unsure = ROBUSTNESS_S * (1 - self.candidates.worth[chosen]) + LEVER_S_M * self.candidates.lever_m[chosen]
        off = NORMAL_95 * forecast.sigma(start_s + leads) - CLEARANCE_M
        delay = leads + np.maximum(off, 0.0) / CORRECTION_M_S
        return delay[:, None, None] + unsure[None, :, None] + EASE_S * (1 - ease)

    def _turned(self, q: Array, reference: Array) -> Array:
        """The same tool axis with the fingers the other way round: the last joint half a turn on, nearest to now."""
        turned = np.array(q)
        last = turned[..., -1] + np.pi
        lower, upper = self.limits.lower_rad[-1], self.limits.upper_rad[-1]
        last = reference[-1] + (last - reference[-1] + np.pi) % (2 * np.pi) - np.pi
        last = np.where(last > upper, last - 2 * np.pi, last)
        turned[..., -1] = np.where(last < lower, last + 2 * np.pi, last)
        return turned
