"""Task I with planned steps."""

import numpy as np
import pytest
import torch

from tr_grasp import keys
from tr_grasp.configs import ActionCfg, EnvCfg, ObjectsCfg, ObservationCfg, RandomisationCfg
from tr_grasp.envs import make_env
from tr_grasp.envs.planned_controller import PlannedController
from tr_grasp.errors import ConfigError
from tr_grasp.motion import MotionLimits, Outcome
from tr_grasp.robots import robot_spec

pytestmark = pytest.mark.sim


@pytest.fixture(scope="module", params=["panda", "ur5_rg2"])
def env(request):
    env = make_env(
        EnvCfg(
            robot=request.param,
            action=ActionCfg(execution="planned"),
            objects=ObjectsCfg(count_range=(1, 1)),
            observation=ObservationCfg(expert_labels=True, stack_n=1),
        ),
        seed=3,
    )
    yield env
    env.close()


def step(env, *action):
    td = env.step(env.reset_td.set(keys.ACTION, torch.tensor(action, dtype=torch.float32)))
    env.reset_td = td["next"].select(*env.observation_spec.keys())


def fresh(env, seed=3):
    env.set_seed(seed)
    env.reset_td = env.reset()
    return env.task.controller


def test_a_step_moves_the_tool_as_far_as_the_action_says_within_the_arms_limits(env):
    controller = fresh(env)
    assert isinstance(controller, PlannedController)
    start = controller.measured_pose()[:3, 3]
    step(env, 0.8, 0.0, -1.0, 0.0, 1.0)
    assert controller.plan.outcome is Outcome.OK
    limits = MotionLimits.of(robot_spec(env.task.cfg.robot))
    assert controller._motion.violations(limits, margin=0.01) == []
    step(env, 0.0, 0.0, 0.0, 0.0, 1.0)
    moved = controller.measured_pose()[:3, 3] - start
    np.testing.assert_allclose(moved, [0.04, 0.0, -0.05], atol=0.004)


def test_without_a_plan_the_arm_stays_and_the_next_step_starts_from_there(env):
    controller = fresh(env)
    planner = controller._planner
    refusing = type("Refusing", (), {"plan": lambda self, *_: type(planner.plan(*_))(Outcome.TIMED_OUT)})()
    target, start = controller.target, controller.measured_pose()[:3, 3]
    controller._planner = refusing
    step(env, 1.0, 0.0, 0.0, 0.0, -1.0)
    assert controller.closing
    assert controller.target == target
    np.testing.assert_allclose(controller.measured_pose()[:3, 3], start, atol=0.003)
    controller._planner = planner
    step(env, 0.0, 0.0, 0.5, 0.0, 1.0)
    assert controller.plan.outcome is Outcome.OK


def test_the_expert_lifts_an_object(env):
    lifted = 0
    for seed in (30000, 30001):
        fresh(env, seed)
        done = env.rollout(60, lambda td: td.set(keys.ACTION, td[keys.EXPERT_ACTION]))
        lifted += bool(done["next", keys.SUCCESS].any())
    assert lifted >= 1


def test_the_same_seed_gives_the_same_episode_to_the_bit(env):
    runs = []
    for other in (11, 12):  # something else happens in between
        fresh(env, other)
        env.rollout(2)
        fresh(env, 30000)
        runs.append(env.rollout(6, lambda td: td.set(keys.ACTION, td[keys.EXPERT_ACTION])))
    for key in (keys.PROPRIO, keys.ACTION, ("next", "reward"), ("next", keys.PROPRIO)):
        assert torch.equal(runs[0][key], runs[1][key])
    assert torch.equal(runs[0][keys.OCTREE].codes, runs[1][keys.OCTREE].codes)
    assert torch.equal(runs[0][keys.OCTREE].features, runs[1][keys.OCTREE].features)


def test_planned_steps_and_latency_do_not_go_together():
    with pytest.raises(ConfigError, match=r"execution cartesian only"):
        EnvCfg(action=ActionCfg(execution="planned"), randomise=RandomisationCfg(latency=True))
