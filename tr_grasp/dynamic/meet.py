"""The planner that meets the object: it searches for where and when, re-plans all the time, and follows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tr_grasp.dynamic.approach import Approach, approach_time_s
from tr_grasp.dynamic.around import way_around
from tr_grasp.dynamic.attempt import CYCLE_S, Run
from tr_grasp.dynamic.course import AFTERWARDS_S
from tr_grasp.dynamic.hopeless import Ending, hopeless
from tr_grasp.dynamic.intercept import NORMAL_95, InterceptSearch
from tr_grasp.dynamic.meeting import Candidates, Found, Meeting
from tr_grasp.dynamic.method import GraspOutcome, Phase
from tr_grasp.dynamic.reach_time import turning_time
from tr_grasp.dynamic.target import Forecast
from tr_grasp.dynamic.tool_path import ToolPoses, follow, moved_along_tool
from tr_grasp.grasps.ranking import rank_grasps
from tr_grasp.motion import Plan

Array = NDArray[np.floating]

HALF_TURNS_AHEAD = 2.0
"""An arm that needs long for half a turn of its joints looks further ahead."""
SEARCH_EVERY_S, RETRY_SEARCH_S, DETOUR_EVERY_S = 0.4, 0.12, 0.5
"""Time between two searches while the arm is after something, and while it is not; and between two for detours."""
RETREAT_M = 0.09
SETTLED_S, JOINTS_WITHIN_RAD = 0.12, 0.1
"""So shortly before the arrival, or so near in every joint, the arm begins to follow instead of aiming again."""
AT_PRE_M = 0.01
"""So near to the pre-grasp the hand goes forward."""
DETOURS_N = 2
FOLLOW_S = 1.6
SURE_M, SURE_WITHIN_S = 0.012, 2.0
"""How far off the forecast for the grasp may be (95 %) for the approach to begin, and for how long that is asked."""
ALIGN_LIMIT_S = 1.5
STUCK_N = 12
"""After so many plans in a row that failed, something else is tried."""
RANKED_N = 10
"""Grasps that are looked at under rankings that choose some."""
RANKING_AHEAD_S = 2.0


class MeetingPlanner:
    """One attempt after the other to be at a grasp at the right time.

    Args:
        run: Of which this is the planner.
    """

    follows_while_closing = True
    """The hand goes along with the object until it is held."""

    def __init__(self, run: Run) -> None:
        self.run, self.cfg = run, run.cfg
        self.approach_s = approach_time_s(run.near_limits, run.cfg.back_off_m)
        half_turn_s = turning_time(np.pi, run.limits)
        self.horizon_s = max(run.cfg.horizon_s, HALF_TURNS_AHEAD * half_turn_s)
        self._search: InterceptSearch | None = None
        self._leaps_n = 0
        self._is_too_near = False
        self._avoid: set[int] = set()
        self._begin()

    def reach(self) -> Ending | None:
        """Come to a grasp, aligned; or why that is not to be."""
        run = self.run
        run.tell(Phase.REACHING)
        self._begin()
        while True:
            run.target.look(run.world)
            if lost := run.lost():
                return GraspOutcome.LOST, lost
            if run.path_is_over() and self._approach is None:
                return GraspOutcome.PATH_FINISHED, ""
            if not run.target.is_known:
                run.world.wait(CYCLE_S)
                continue
            began_s = run.now_s
            searches = self._is_search_due()
            with run.thinking("planning", kind="search" if searches else "loop"):
                ending = self._think(searches)
            if run.was_late and self._approach is None:
                self._begin()
            if ending is not None:
                return ending
            run.world.wait(max(CYCLE_S - (run.now_s - began_s), 0.0))
            if self._is_too_near:
                self._is_too_near = False
                run.let_go(RETREAT_M)
                continue
            if self._approach is not None and self._is_aligned():
                return None

    def grasp(self) -> tuple[Forecast, Array]:
        """The forecast by which the hand follows now, and ``T_obj_tcp`` of the grasp."""
        assert self._forecast is not None
        assert self._meeting is not None
        return self._forecast, self._meeting.T_obj_tcp

    def failed(self) -> None:
        """The grasp did not hold: choose another one."""
        if self._meeting is not None:
            self._avoid.add(self._meeting.number)

    def _begin(self) -> None:
        self._meeting: Meeting | None = None
        self._approach: Approach | None = None
        self._forecast: Forecast | None = None
        self._plan: Plan | None = None
        self._searched_s: float | None = None
        self._hopeless_since_s: float | None = None
        self._hover_since_s: float | None = None
        self._stuck_n, self._detour_s = 0, -np.inf

    def _is_search_due(self) -> bool:
        if self._approach is not None:
            return False
        since_s = np.inf if self._searched_s is None else self.run.now_s - self._searched_s
        due_s = RETRY_SEARCH_S if self._meeting is None else SEARCH_EVERY_S if self.cfg.switching else np.inf
        return bool(since_s >= due_s)

    def _think(self, searches: bool) -> Ending | None:
        run = self.run
        run.loops += 1
        start_s = run.now_s + run.lead_s("search" if searches else "loop")
        forecast = run.target.forecast(run.now_s, start_s + self.horizon_s + 4.0)
        self._forecast = forecast
        run.scene.expect(forecast)
        if run.target.leaps_n != self._leaps_n:
            self._leaps_n = run.target.leaps_n
            self._drop()
        if self._approach is not None or self._is_there(forecast, start_s):
            self._follow(forecast, start_s)
            return None
        if self._meeting is not None:
            self._refresh(forecast, start_s)
        if searches:
            return self._choose(forecast, start_s)
        return None

    def _choose(self, forecast: Forecast, start_s: float) -> Ending | None:
        """Look for the best meeting, and take it if it is clearly better than what the arm is after."""
        run, start = self.run, self.run.arm.commanded(start_s)
        search = self._searcher(forecast, start.q, start_s)
        if search is None:
            return self._no_hope(Found(0, 0, 0), forecast, start_s)
        found = search.search(forecast, start, start_s)
        run.notes["ik_calls"] += len(search.candidates) / 2
        self._searched_s = start_s
        best = found.best
        if best is None and self._meeting is None and found.blocked and start_s >= self._detour_s:
            best, self._detour_s = self._around(search, found, forecast, start_s), start_s + DETOUR_EVERY_S
        if best is None and self._meeting is None:
            run.step_out(start, start_s)
            return self._no_hope(found, forecast, start_s)
        if best is None:
            return None
        self._hopeless_since_s = None
        now = self._meeting
        if now is not None:
            mine = now.cost_s - (start_s - now.start_s)
            if now.number == best.number or best.cost_s > (1 - self.cfg.switch_gain) * mine:
                return None
            run.switches += 1
        if run.send(best.way, best.start_s):
            self._meeting, self._stuck_n = best, 0
        return None

    def _refresh(self, forecast: Forecast, start_s: float) -> None:
        """Aim again at the same grasp, with what is known now."""
        run, meeting = self.run, self._meeting
        assert meeting is not None
        assert self._search is not None
        start = run.arm.commanded(start_s)
        if not self.cfg.seeding and meeting.arrival_s - start_s > 1.0:
            return
        again = self._search.again(forecast, start, start_s, meeting)
        if again is not None and self._plan is not None and again.arrival_s > meeting.arrival_s + 0.1:
            again = None  # the way around is quicker than going straight from here
        if again is not None and run.send(again.way, start_s):
            self._meeting, self._stuck_n, self._plan = again, 0, None
            return
        self._stuck_n += 1
        goal = self._search.goal(forecast, meeting.candidate, meeting.q, meeting.arrival_s)
        # A plan that was searched for may begin later than this loop could act: then all of it is still ahead.
        gone_s, blocked = max(start_s - meeting.start_s, 0.0), False
        if gone_s < meeting.way.duration_s:
            blocked = not run.scene.is_free(meeting.way.cut(gone_s), max(start_s, meeting.start_s))
        if goal is None or blocked or (self._plan is None and self._stuck_n > STUCK_N):
            self._drop()

    def _is_there(self, forecast: Forecast, start_s: float) -> bool:
        """The arm is about to arrive at the pre-grasp; or so near that Algorithm 1 would begin its approach.

        The latter counts where the arm may do more near the object than on its ways.
        """
        meeting = self._meeting
        if meeting is None:
            return False
        if meeting.arrival_s - start_s < SETTLED_S:
            return True
        if self.cfg.limits == self.cfg.approach_limits:
            return False
        assert self._search is not None
        goal = self._search.goal(forecast, meeting.candidate, meeting.q, start_s)
        q = self.run.arm.commanded(start_s).q
        return goal is not None and bool(np.abs(goal.q - q).max() < JOINTS_WITHIN_RAD)

    def _begins_s(self, forecast: Forecast, start_s: float) -> float | None:
        """When the hand may go forward: at the planned arrival, or now if it is there; nothing if it is not near."""
        meeting = self._meeting
        assert meeting is not None
        if meeting.arrival_s - start_s < SETTLED_S:
            return max(start_s, meeting.arrival_s)
        T_pre = self._tool_poses(forecast, meeting)(np.array([start_s]))[0]
        T = self.run.kinematics.pose(self.run.arm.commanded(start_s).q)
        return start_s if np.linalg.norm(T[:3, 3] - T_pre[:3, 3]) < AT_PRE_M else None

    def _follow(self, forecast: Forecast, start_s: float) -> None:
        """At the pre-grasp and from there to the grasp: keep up with the object, hand in its frame."""
        run, meeting, begins = self.run, self._meeting, None
        assert meeting is not None
        assert self._search is not None
        start = run.arm.commanded(start_s)
        if self._approach is None and self._is_sure(forecast, start_s):
            begins = self._begins_s(forecast, start_s)
        if begins is not None:
            if not self._search.can_go_on(forecast, meeting.candidate, start.q, begins):
                self._drop()
                return
            self._approach = Approach(begins, self.approach_s)
            run.tell(Phase.APPROACHING)
        path = follow(run.kinematics, run.near_limits, self._tool_poses(forecast, meeting), start, start_s, FOLLOW_S)
        # An approach that waits to be aligned may be overdue: then the grasp is still ahead.
        done_s = start_s + self.approach_s if self._approach is None else max(start_s, self._approach.ends_s)
        is_clear = path is not None and run.scene.is_free_at_grasp(path, start_s, done_s + AFTERWARDS_S)
        if path is not None and is_clear and run.send(path, start_s):
            self._stuck_n = 0
            return
        self._stuck_n += 1
        if self._stuck_n > STUCK_N or self._is_overdue(start_s):
            self._drop()

    def _tool_poses(self, forecast: Forecast, meeting: Meeting) -> ToolPoses:
        approach, back_off = self._approach, self.cfg.back_off_m

        def poses(times_s: Array) -> Array:
            T = forecast.poses(times_s) @ meeting.T_obj_tcp
            back = np.full(len(times_s), back_off) if approach is None else approach.back_m(times_s, back_off)
            return moved_along_tool(T, back)

        return poses

    def _is_sure(self, forecast: Forecast, start_s: float) -> bool:
        self._hover_since_s = start_s if self._hover_since_s is None else self._hover_since_s
        off = NORMAL_95 * forecast.sigma(np.array([start_s + self.approach_s]))[0]
        return bool(off < SURE_M) or start_s - self._hover_since_s > SURE_WITHIN_S

    def _is_aligned(self) -> bool:
        run, approach = self.run, self._approach
        assert approach is not None
        assert self._forecast is not None
        assert self._meeting is not None
        if run.now_s < approach.ends_s:
            return False
        T = self._forecast.poses(np.array([run.now_s]))[0] @ self._meeting.T_obj_tcp
        off_m, off_rad = run.tool_error(T)
        if off_m < self.cfg.close_within_m and off_rad < np.deg2rad(self.cfg.close_within_deg):
            return True
        if self._is_overdue(run.now_s):
            self._drop()
        return False

    def _is_overdue(self, now_s: float) -> bool:
        approach = self._approach
        return approach is not None and now_s > approach.ends_s + ALIGN_LIMIT_S

    def _drop(self) -> None:
        """Forget what the arm is after; from an approach that was broken off, the hand has to get away first."""
        if self._approach is not None:
            self.failed()
            self._is_too_near = True
            self.run.tell(Phase.REACHING)
        self._begin()

    def _around(self, search: InterceptSearch, found: Found, forecast: Forecast, start_s: float) -> Meeting | None:
        """A way with a detour to one of the meetings whose direct way is blocked."""
        run = self.run
        for candidate, q, arrival_s in found.blocked[:DETOURS_N]:
            run.notes["planner_calls"] += 1
            previous = self._plan if self.cfg.seeding else None
            found_way = way_around(run.scene, run.limits, run.arm.commanded(start_s), start_s, q, arrival_s, previous)
            if found_way is None:
                continue
            plan, way = found_way
            arrival_s = start_s + way.duration_s
            goal = search.goal(forecast, candidate, q, arrival_s)
            if goal is not None and search.can_go_on(forecast, candidate, goal.q, arrival_s):
                self._plan = plan
                return search.meeting(forecast, candidate, goal.q, start_s, arrival_s, way)
        return None

    def _searcher(self, forecast: Forecast, q: Array, start_s: float) -> InterceptSearch | None:
        """The search over the grasps that the ranking names; nothing if it names none."""
        run, cfg = self.run, self.cfg
        if cfg.ranking in ("ours", "none") and self._search is not None and not self._avoid:
            return self._search
        grasps = run.task.grasps
        if cfg.ranking in ("ours", "none"):
            chosen = np.arange(len(grasps))
        else:
            T = forecast.poses(np.array([start_s + RANKING_AHEAD_S]))[0]
            aids = run.aids(forecast, start_s)
            chosen = rank_grasps(run.kinematics, grasps, T, q, cfg.ranking, cfg.back_off_m, aids)[:RANKED_N]
        kept = np.array([i for i in chosen if i not in self._avoid], int)
        chosen = kept if len(kept) else chosen
        if not len(chosen):
            return None
        candidates = Candidates.of(grasps, chosen)
        # A meeting names its candidate by its place among them: they stay while the arm is after one.
        before = self._search
        if self._meeting and before and not np.array_equal(candidates.number, before.candidates.number):
            return before
        self._search = InterceptSearch(
            run.scene, run.limits, candidates, cfg.back_off_m, self.horizon_s, self.approach_s, run.task.lift_m
        )  # fmt: skip
        return self._search

    def _no_hope(self, found: Found, forecast: Forecast, start_s: float) -> Ending | None:
        """Nothing to be met: an ending if that has been so for long enough and will not change."""
        self._hopeless_since_s = start_s if self._hopeless_since_s is None else self._hopeless_since_s
        since_s = start_s - self._hopeless_since_s
        return (
            None
            if since_s < self.cfg.hopeless_after_s
            else hopeless(self.run, found, forecast, start_s, since_s, self.horizon_s)
        )
