"""A collision-free path to a joint or tool goal: straight where that is free, around obstacles where not."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from tr_grasp.errors import MotionError
from tr_grasp.motion.arguments import Array, joint_vector, one_of, transforms
from tr_grasp.motion.collision import CollisionModel
from tr_grasp.motion.edges import path_is_free, path_length
from tr_grasp.motion.inverse_kinematics import IKCfg, inverse_kinematics
from tr_grasp.motion.joint_turns import distance
from tr_grasp.motion.outcome import Outcome
from tr_grasp.motion.plan import MODES, Cancel, How, Mode, Plan, PlannerCfg
from tr_grasp.motion.reuse import bend_to, free_beginning, rest_of
from tr_grasp.motion.rrt_connect import rrt_connect
from tr_grasp.motion.shortcut import shortcut
from tr_grasp.motion.straight import joint_line, tool_line

SAME_RAD = 1e-6
LIMIT_TOLERANCE_RAD = 1e-6
BRIEF_ROUNDS_N = 300
SAME_POSTURE_RAD = 1.0
"""Goals further apart than this are reached in different postures."""
FINENESS = (1, 2, 4)
"""How much finer than set RRT-Connect checks its edges, in its first, second and third search."""


class Planner:
    """Plans paths of one arm among obstacles that stand still while it plans.

    Args:
        model: The arm and what is around it.
        cfg: Settings.
    """

    def __init__(self, model: CollisionModel, cfg: PlannerCfg | None = None) -> None:
        self.model, self.cfg = model, cfg or PlannerCfg()

    def plan(
        self,
        start_q: ArrayLike,
        goal: ArrayLike,
        *,
        mode: Mode = "auto",
        previous: Plan | None = None,
        cancel: Cancel | None = None,
        time_s: float = 0.0,
    ) -> Plan:
        """A path from joints to a goal.

        Args:
            start_q: (dof,) joints now.
            goal: (dof,) joints, or ``T_base_tcp`` (4, 4), which is reached in the posture nearest to the start, or to
                the end of ``previous``, that is free.
            mode: ``joint`` or ``cartesian`` for a straight line of joints or tool and nothing else, ``rrt_connect`` for
                a search, ``auto`` for what works first: the tool's line where the goal is a near tool pose, the joints'
                line, the search.
            previous: A plan to much the same goal. What of it is still ahead is kept where it can be, so that plans
                follow one another without leaps and in less time; only in mode ``auto``.
            cancel: Asked again and again while searching; true gives up.
            time_s: Time of the world at which moving obstacles are taken to stand.

        Returns:
            A plan whose ``outcome`` says how it ended; its path has been checked at half the resolution.

        Raises:
            MotionError: NaN, another number of joints, a pose that is not rigid, or no such mode.
        """
        one_of("mode", mode, MODES)
        begun = time.perf_counter()
        attempt = _Attempt(self.model, self.cfg, cancel, time_s)
        start = joint_vector("start_q", start_q, self.model.kinematics.dof)
        goal_q, T_goal = self._goal(goal)
        plan = attempt.run(start, goal_q, T_goal, mode, previous)
        return replace(plan, seconds=time.perf_counter() - begun)

    def _goal(self, goal: ArrayLike) -> tuple[Array | None, Array | None]:
        dof = self.model.kinematics.dof
        shape = np.shape(goal)
        if shape == (4, 4):
            return None, transforms("goal", goal)
        if len(shape) == 1:
            return joint_vector("goal", goal, dof), None
        raise MotionError(f"goal must be {dof} joints or one pose (4, 4), got an array of shape {shape}.")


class _Attempt:
    """One call of :meth:`Planner.plan`."""

    def __init__(self, model: CollisionModel, cfg: PlannerCfg, cancel: Cancel | None, time_s: float) -> None:
        self.model, self.cfg, self.cancel, self.time_s = model, cfg, cancel, time_s
        self.until = time.thread_time() + cfg.time_limit_s
        self.rng = np.random.default_rng(cfg.seed)

    def run(self, start: Array, goal_q: Array | None, T_goal: Array | None, mode: Mode, previous: Plan | None) -> Plan:
        refusal = self._refuse(start, Outcome.START_OUTSIDE_LIMITS, Outcome.START_IN_COLLISION)
        if refusal is not None:
            return refusal
        past = previous.path if previous is not None else None
        postures = self._postures(start if past is None else past[-1], goal_q, T_goal)
        if past is not None and not isinstance(postures, Plan) and distance(postures[0], past[-1]) > SAME_POSTURE_RAD:
            # The posture in which it ended is not free any more, and what it knew of the way there is no help.
            past, postures = None, self._postures(start, goal_q, T_goal)
        if isinstance(postures, Plan):
            return postures
        if distance(postures[0], start) < SAME_RAD:
            return Plan(Outcome.ALREADY_THERE, start[None])
        if self._is_cancelled():
            return Plan(Outcome.CANCELLED)
        if mode == "cartesian":
            T = self.model.kinematics.pose(postures[0]) if T_goal is None else T_goal
            return self._valid(tool_line(self.model, start, T, self.cfg, self.time_s))
        if mode == "joint":
            return self._valid(joint_line(self.model, start, postures[0], self.cfg, self.time_s))
        last = Plan(Outcome.TIMED_OUT)
        for candidate in self._candidates(start, postures, T_goal, mode, past):
            checked = self._valid(candidate)
            if checked.outcome.succeeded:
                return checked
            last = checked
            if self._is_cancelled():
                break
        return Plan(Outcome.CANCELLED) if self._is_cancelled() else last

    def _candidates(
        self, start: Array, postures: Array, T_goal: Array | None, mode: Mode, past: Array | None
    ) -> Iterator[Plan]:
        """Plans in the order of what they cost; those that fail their check are passed over."""
        if mode == "auto":
            if T_goal is not None and self._is_near(start, T_goal):
                yield tool_line(self.model, start, T_goal, self.cfg, self.time_s)
            if past is not None:
                yield from self._from_past(start, postures[0], past)
            for posture in postures:
                yield joint_line(self.model, start, posture, self.cfg, self.time_s)
        # A plan that is to follow another one stays in its posture, if that can be reached.
        if past is not None:
            yield from self._searches(start, postures[:1], self._brief, share=0.5)
        yield from self._searches(start, postures, self.cfg)

    def _from_past(self, start: Array, goal: Array, past: Array) -> Iterator[Plan]:
        fine, rest = self.fine_rad, rest_of(past, start)
        if (bent := bend_to(self.model, rest, goal, fine, self.time_s)) is not None:
            yield self._shortened(bent, "reused", self.cfg.reused_shortcuts_n)
            return
        kept = free_beginning(self.model, rest[:-1] if len(rest) > 1 else rest, fine, self.time_s)
        end = self._around(kept[-1], goal[None], self._left() / 2, self._brief)
        if end is not None:
            yield self._shortened(np.vstack([kept[:-1], end]), "repaired", self.cfg.reused_shortcuts_n)

    def _searches(self, start: Array, goals: Array, cfg: PlannerCfg, share: float = 1.0) -> Iterator[Plan]:
        """Where a path does not pass its check at half the resolution, the next search is finer.

        ``share`` is the part of the time left that they may take.
        """
        until = time.thread_time() + share * self._left()
        for i, fineness in enumerate(FINENESS):
            finer = replace(cfg, resolution_rad=cfg.resolution_rad / fineness, seed=cfg.seed + i)
            path = self._around(start, goals, until - time.thread_time(), finer)
            if path is None:
                yield Plan(Outcome.TIMED_OUT, detail=self._budget)
                return
            yield self._shortened(path, "rrt_connect", self.cfg.shortcuts_n)

    def _around(self, start: Array, goals: Array, seconds: float, cfg: PlannerCfg) -> Array | None:
        until = min(self.until, time.thread_time() + seconds)
        return rrt_connect(self.model, start, goals, cfg, until=until, cancel=self.cancel, time_s=self.time_s)

    def _shortened(self, path: Array, how: How, attempts_n: int) -> Plan:
        if not path_is_free(self.model, path, self.fine_rad, self.time_s):
            return Plan(Outcome.INVALIDATED)
        short = shortcut(self.model, path, attempts_n, self.fine_rad, self.rng, self.time_s)
        return Plan(Outcome.OK, short, how, raw_length_rad=path_length(path))

    def _valid(self, plan: Plan) -> Plan:
        """The plan if it passes at half the resolution; its length before shortcuts filled in."""
        if plan.path is None:
            return plan
        if not path_is_free(self.model, plan.path, self.fine_rad, self.time_s):
            return Plan(Outcome.INVALIDATED)
        return replace(plan, raw_length_rad=plan.raw_length_rad or plan.length_rad)

    @property
    def _brief(self) -> PlannerCfg:
        """For searches that are tried before the one to all goals: what they miss it may find, in any posture."""
        rounds = BRIEF_ROUNDS_N if self.cfg.rounds_n is None else min(self.cfg.rounds_n, BRIEF_ROUNDS_N)
        return replace(self.cfg, rounds_n=rounds)

    @property
    def _budget(self) -> str:
        rounds = f" or {self.cfg.rounds_n} rounds" if self.cfg.rounds_n is not None else ""
        return f"{self.cfg.time_limit_s:g} s{rounds}"

    @property
    def fine_rad(self) -> float:
        """Resolution at which what was found is shortened and checked."""
        return self.cfg.resolution_rad / 2

    def _postures(self, reference: Array, goal_q: Array | None, T_goal: Array | None) -> Array | Plan:
        """Free joint goals (m, dof), the nearest to the reference first, or why there are none."""
        if T_goal is None:
            assert goal_q is not None
            refusal = self._refuse(goal_q, Outcome.GOAL_OUTSIDE_LIMITS, Outcome.GOAL_IN_COLLISION)
            return goal_q[None] if refusal is None else refusal
        found = inverse_kinematics(
            self.model.kinematics, T_goal, reference, IKCfg(postures_n=self.cfg.postures_n)
        ).all_of()
        if not len(found):
            return Plan(Outcome.UNREACHABLE, detail=f"tool at {np.round(T_goal[:3, 3], 4).tolist()} m")
        free = self.model.free(found, self.time_s)
        if not free.any():
            return Plan(Outcome.GOAL_IN_COLLISION, detail=self._contact(found[0]))
        return found[free]

    def _refuse(self, q: Array, outside: Outcome, in_collision: Outcome) -> Plan | None:
        arm = self.model.kinematics
        wrong = np.flatnonzero((q < arm.lower_rad - LIMIT_TOLERANCE_RAD) | (q > arm.upper_rad + LIMIT_TOLERANCE_RAD))
        if len(wrong):
            i = int(wrong[0])
            limits = f"[{arm.lower_rad[i]:.4g}, {arm.upper_rad[i]:.4g}]"
            return Plan(outside, detail=f"{arm.spec.joint_names[i]} is at {q[i]:.4g} rad, {limits} is allowed")
        if not self.model.free(q, self.time_s)[0]:
            return Plan(in_collision, detail=self._contact(q))
        return None

    def _contact(self, q: Array) -> str:
        return str(self.model.contact(q, self.time_s) or "two bodies all but touch")

    def _is_near(self, start: Array, T_goal: Array) -> bool:
        way = self.model.kinematics.pose(start)[:3, 3] - T_goal[:3, 3]
        return bool(np.linalg.norm(way) < self.cfg.cartesian_within_m)

    def _is_cancelled(self) -> bool:
        return self.cancel is not None and bool(self.cancel())

    def _left(self) -> float:
        return max(0.0, self.until - time.thread_time())
