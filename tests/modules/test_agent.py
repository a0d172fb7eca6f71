from __future__ import annotations

from dataclasses import replace

import pytest
import torch
from torchrl.envs.utils import ExplorationType, check_env_specs, set_exploration_type

from tests.toy_env import env_spec, make_env, train_cfg
from tr_grasp.keys import ACTION, ACTOR_FEATURES
from tr_grasp.modules import build_agent, build_loss


def make_agent(**network):
    cfg = train_cfg()
    cfg = replace(cfg, network=replace(cfg.network, **network))
    return build_agent(cfg, env_spec(cfg.env)), cfg


def test_the_toy_environment_keeps_its_promises():
    check_env_specs(make_env(train_cfg().env, 0))


def test_the_policy_acts_on_one_environment_and_on_batches_alike():
    agent, cfg = make_agent()
    with torch.no_grad():
        steps = make_env(cfg.env, 0).rollout(6, break_when_any_done=False)
        single = torch.stack([agent.policy(step.clone())[ACTION] for step in steps])
        torch.testing.assert_close(agent.policy(steps.clone())[ACTION], single)


def test_the_policy_writes_the_action_and_nothing_else():
    agent, cfg = make_agent()
    observation = make_env(cfg.env, 0).reset()
    before = set(observation.keys())
    assert set(agent.policy(observation).keys()) - before == {ACTION}


def test_the_policy_is_deterministic_unless_exploration_is_asked_for():
    agent, cfg = make_agent()
    observation = make_env(cfg.env, 0).reset()

    def act(kind=None):
        with torch.no_grad(), set_exploration_type(kind):
            return agent.policy(observation.clone())[ACTION]

    features = agent.encoder(observation.clone())[ACTOR_FEATURES]
    mean, _ = agent.actor.module[0].module(features)
    torch.testing.assert_close(act(), torch.tanh(mean).detach())
    assert torch.equal(act(), act(ExplorationType.DETERMINISTIC))
    assert not torch.equal(act(ExplorationType.RANDOM), act(ExplorationType.RANDOM))


@pytest.mark.parametrize("sees_stages", [True, False])
def test_only_critics_may_see_the_stages(sees_stages):
    agent, _ = make_agent(critic_sees_stages=sees_stages)
    assert ("stages" in agent.critics[0].in_keys) == sees_stages
    assert "stages" not in agent.policy.in_keys


@pytest.mark.filterwarnings("ignore:No target network updater")
def test_settings_reach_the_loss():
    agent, cfg = make_agent()
    algorithm = replace(cfg.algorithm, alpha_min=0.2, alpha_init=0.1, critic_reduction="mean", encoder_grad="both")
    loss = build_loss(replace(cfg, algorithm=algorithm), agent)
    assert float(loss._alpha) == pytest.approx(0.2)
    assert (loss.critic_reduction, loss.encoder_grad) == ("mean", "both")
    assert loss.value_estimator.gamma == pytest.approx(cfg.algorithm.gamma)
    assert float(loss.target_entropy) == cfg.algorithm.target_entropy
