"""The thesis' planner in parts: where it approaches from, how its plans follow one another, how it leaves a contact."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.dynamic.stations import arm, line, scene
from tr_grasp.dynamic.algorithm1 import Algorithm1
from tr_grasp.dynamic.attempt import Run
from tr_grasp.dynamic.settings import GrasperCfg
from tr_grasp.dynamic.step_out import STEP_OUT_RAD
from tr_grasp.dynamic.tool_path import entered, moved_along_tool
from tr_grasp.errors import GraspError
from tr_grasp.hardware import Follower
from tr_grasp.motion import JointState, MotionLimits, Outcome, Trajectory, inverse_kinematics

LINE = Trajectory([0.0, 1.0], [[0.0], [1.0]], [[1.0], [1.0]])


def limits(acceleration: float) -> MotionLimits:
    return MotionLimits([-9.0], [9.0], [5.0], [acceleration], [1e6])


def ready(cfg: GrasperCfg | None = None, off_m=(0.0, 0.0, 0.0)) -> Algorithm1:
    """The planner a second after the start, its hand at a pre-grasp that was chosen, or beside it."""
    station, task = scene(line((0.5, -0.05)))
    run = Run(station, task, cfg or GrasperCfg.thesis())
    station.world.wait(1.0)
    run.target.look(station.world)
    planner = Algorithm1(run)
    T_obj = run.target.last_pose
    forecast = run.target.forecast(run.now_s, run.now_s + 3.0)
    run.scene.expect(forecast)
    for T_obj_tcp in run.task.grasps.grasps.poses():
        T = moved_along_tool(T_obj @ T_obj_tcp, run.cfg.back_off_m)
        q_pre = inverse_kinematics(run.kinematics, T, arm().home_q_rad).q_rad
        T[:3, 3] += off_m
        q = inverse_kinematics(run.kinematics, T, q_pre).q_rad
        if np.isfinite(q).all() and run.scene.way.free(q, np.array([run.now_s])).all():
            break
    station.arm._follower = Follower(station.arm.limits, q, lambda: station.world.now_s)
    planner._q_pre, planner._T_obj_tcp, planner._number = q_pre, T_obj_tcp, 0
    return planner


def test_what_a_trajectory_is_off_vanishes_as_a_cubic() -> None:
    """0.5 rad off, at the right speed: half of it is left in the middle of the blend, none after it."""
    start = JointState(np.array([0.5]), np.array([1.0]), np.zeros(1))
    path = entered(LINE, start, limits(100.0), (0.4,))
    assert path is not None
    assert path.start.q == pytest.approx([0.5])
    assert path.start.dq == pytest.approx([1.0])
    assert path.sample([0.2, 0.4, 0.7]).q[:, 0] == pytest.approx([0.2 + 0.25, 0.4, 0.7])


def test_the_first_blend_that_the_limits_allow_is_taken_and_none_is_longer_than_the_path() -> None:
    """A cubic of height d over t accelerates by 6 d / t² at most: 0.5 rad in 0.5 s takes 12 rad/s²."""
    start = JointState(np.array([0.5]), np.array([1.0]), np.zeros(1))
    quick, slow = entered(LINE, start, limits(13.0), (0.5, 0.8)), entered(LINE, start, limits(11.0), (0.5, 0.8))
    assert quick is not None
    assert slow is not None
    assert quick.sample(0.5).q == pytest.approx([0.5])
    assert slow.sample(0.5).q[0] > 0.55
    assert entered(LINE, start, limits(1.0), (0.5, 0.8, 1.6)) is None


def test_the_approach_joins_the_line_of_the_grasp_from_beside_it() -> None:
    planner = ready(off_m=(0.0, 0.0, 0.04))
    run = planner.run
    assert planner._approach()
    forecast, T_obj_tcp = planner.grasp()
    off_m, off_rad = run.tool_error(forecast.poses(np.array([run.now_s]))[0] @ T_obj_tcp)
    assert off_m < 0.012  # of which 0.2 s of the reading's age at 3 cm/s are 6 mm
    assert off_rad < 0.02
    before = run.kinematics.pose(run.arm.state().q_rad)[:3, 3]
    run.world.wait(0.5)
    moved = run.kinematics.pose(run.arm.state().q_rad)[:3, 3] - before
    expected = forecast.states(np.array([run.now_s, run.now_s - 0.5]))[0]
    np.testing.assert_allclose(moved, expected[0] - expected[1], atol=1e-3)  # it goes along


def test_a_tenth_of_the_limits_is_too_slow_for_what_the_simulation_of_the_thesis_jumps() -> None:
    cfg = replace(GrasperCfg.thesis(), approach_limits="thesis")
    assert not ready(cfg, off_m=(0.0, 0.0, 0.06))._approach()


def test_a_plan_that_replaces_another_keeps_what_the_arm_has_of_its_speed() -> None:
    planner = ready()
    path = np.stack([np.zeros(6), np.full(6, 0.3)])
    across = np.array([0.1, 0.1, 0.1, -0.1, 0.1, 0.1])
    way = planner._timed(path, JointState(path[0], across, np.zeros(6)))
    assert way is not None
    np.testing.assert_allclose(way.start.dq, across, atol=1e-9)
    np.testing.assert_allclose(way.end.q, path[-1], atol=1e-9)
    assert not way.violations(planner.run.arm.limits)


def test_a_start_that_touches_the_object_is_stepped_out_of() -> None:
    planner = ready()
    run = planner.run
    T = run.target.last_pose @ planner._T_obj_tcp
    T[:3, 3] += 0.03 * T[:3, 0]  # to where a finger is inside the object
    goal = planner._q_pre
    q = inverse_kinematics(run.kinematics, T, goal).q_rad
    assert planner._planner.plan(q, goal, time_s=run.now_s).outcome is Outcome.START_IN_COLLISION
    plan = planner._planned(q, goal, run.now_s)
    assert plan.path is not None
    np.testing.assert_allclose(plan.path[0], q)
    assert np.abs(plan.path[1] - q).max() <= STEP_OUT_RAD
    assert run.scene.way.free(plan.path[1], np.array([run.now_s])).all()


def test_the_thesis_uses_the_grasps_that_never_failed() -> None:
    run = ready().run
    assert (run.task.grasps.successes == run.task.grasps.tries).all()
    station, task = scene(line())
    assert len(Run(station, task, GrasperCfg()).task.grasps) == len(task.grasps) > len(run.task.grasps)
    worse = replace(task, grasps=replace(task.grasps, successes=0 * task.grasps.successes + 40))
    with pytest.raises(GraspError, match="held in 100 % of its tries, the best in 80 %"):
        Run(station, worse, GrasperCfg.thesis())
