"""The nine stages in physics, and the same station as a gymnasium task."""

from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest

import tr_grasp.envs  # noqa: F401 -- registers the task
from tr_grasp.envs.pick_place_view import strip_of
from tr_grasp.envs.pick_place_world import OBJECT, judge, pick_place_world
from tr_grasp.evaluation.pick_place import pick_place_trials
from tr_grasp.motion import Kinematics, time_optimal
from tr_grasp.pick_place import BoxCfg, read_station
from tr_grasp.robots import robot_spec

pytestmark = pytest.mark.sim


@pytest.mark.slow
def test_a_bottle_a_little_off_is_placed_and_no_wall_is_touched():
    (trial,) = pick_place_trials(read_station("thesis"), [0])
    assert trial.succeeded
    assert trial.outcome == "DONE"
    assert trial.cycle_s < 40


def test_the_judge_sees_a_bottle_that_stays():
    cfg = read_station("thesis")
    station = pick_place_world(cfg, physics_hz=120)
    station.world.wait(0.2)
    before = judge(station, cfg)
    assert not before.placed
    assert before.touches == ()
    assert before.object_m[:2] == pytest.approx(cfg.object.foot_m[:2], abs=2e-3)


def test_a_wall_that_the_hand_runs_into_is_counted():
    thesis = read_station("thesis")
    q = np.array(thesis.home_q_rad)
    swung = q + 0.5 * np.eye(7)[0]
    T = Kinematics(robot_spec(thesis.robot)).pose(swung)
    x, y, z = T[:3, 3] - 0.08 * T[:3, 2]  # in the palm: open fingertips end short of the tcp
    post = BoxCfg(size_m=(0.04, 0.04, 0.2), centre_m=(float(x), float(y), float(z)))
    cfg = replace(thesis, boxes={"post": post}, not_to_touch=("post",))
    station = pick_place_world(cfg, physics_hz=120)
    station.arm.move(time_optimal(np.stack([q, swung]), station.arm.limits).trajectory)
    station.world.wait(1.5)
    touches = judge(station, cfg).touches
    assert {touch.thing for touch in touches} == {"post"}
    assert max(touch.force_n for touch in touches) > 0


def test_the_gymnasium_task_moves_joints_and_repeats_by_seed():
    env = gym.make("BlindPickPlace-v1", disable_env_checker=True)
    try:
        first, info = env.reset(seed=5)
        again, _ = env.reset(seed=5)
        other, _ = env.reset(seed=6)
        assert not info["success"]
        assert env.observation_space.contains(first)
        assert first["object_position_m"] == pytest.approx(again["object_position_m"], abs=1e-6)
        assert not np.allclose(first["object_position_m"], other["object_position_m"])
        action = np.zeros(8, np.float32)
        action[0], action[-1] = 0.5, 1.0
        for _ in range(5):
            after, reward, terminated, truncated, _ = env.step(action)
        turned = after["q_rad"] - other["q_rad"]
        assert turned[0] > 0.02
        assert np.abs(turned[1:]).max() < 5e-3
        assert (reward, terminated, truncated) == (0.0, False, False)
        picture = env.render()
        assert picture.shape == (300, 300, 3)
        assert strip_of([("home", picture)] * 9).startswith(b"\x89PNG")
        assert env.unwrapped.station.world.true_pose(OBJECT)[2, 3] > 0.05
    finally:
        env.close()
