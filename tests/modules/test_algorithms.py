"""SAC, TD3 and DDPG behind the same interface as TQC, and the target networks of all."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch
from tensordict import TensorDict
from tensordict.nn import TensorDictModule, TensorDictSequential
from torch import nn
from torchrl.modules import ProbabilisticActor, TanhNormal, ValueOperator
from torchrl.objectives import DDPGLoss, SACLoss, SoftUpdate, TD3Loss

from tests.modules.small_networks import ACTION_N, BATCH, FEATURES_N, make_batch, make_encoder
from tests.modules.transitions import transitions
from tests.toy_env import env_spec, train_cfg
from tr_grasp.modules import (
    DeterministicActor,
    EncodedDDPGLoss,
    EncodedSACLoss,
    EncodedTD3Loss,
    EncodedTQCLoss,
    GaussianActor,
    QuantileCritic,
    TargetUpdate,
    build_agent,
    build_loss,
)

pytestmark = pytest.mark.filterwarnings("ignore:No target network updater")

STOCHASTIC = {"alpha_init": 0.1, "target_entropy": -3.0, "loss_function": "l2"}
SMOOTHING = {"bounds": (-1.0, 1.0), "policy_noise": 0.2, "noise_clip": 0.5, "loss_function": "l2"}
SETTINGS = {"sac": STOCHASTIC, "td3": SMOOTHING, "ddpg": {"loss_function": "l2"}}
OURS = {"sac": EncodedSACLoss, "td3": EncodedTD3Loss, "ddpg": EncodedDDPGLoss}


@pytest.fixture(autouse=True)
def _float64():
    torch.set_default_dtype(torch.float64)
    yield
    torch.set_default_dtype(torch.float32)


def make_actor(name: str, key: str) -> TensorDictSequential:
    if name == "sac":
        head = TensorDictModule(GaussianActor(FEATURES_N, ACTION_N, (16,)), in_keys=[key], out_keys=["loc", "scale"])
        return ProbabilisticActor(head, in_keys=["loc", "scale"], distribution_class=TanhNormal)
    head = TensorDictModule(DeterministicActor(FEATURES_N, ACTION_N, (16,)), in_keys=[key], out_keys=["loc"])
    return TensorDictSequential(head, TensorDictModule(torch.tanh, in_keys=["loc"], out_keys=["action"]))


def make_critics(name: str, key: str) -> list[ValueOperator]:
    n = 1 if name == "ddpg" else 2
    return [
        ValueOperator(QuantileCritic(FEATURES_N, ACTION_N, 1, hidden_n=(16,)), in_keys=[key, "action"])
        for _ in range(n)
    ]


def torchrls(name: str, actor, critics):
    if name == "sac":
        return SACLoss(actor, critics, num_qvalue_nets=2, deactivate_vmap=True, **STOCHASTIC)
    if name == "td3":
        return TD3Loss(actor, critics, num_qvalue_nets=2, deactivate_vmap=True, **SMOOTHING)
    return DDPGLoss(actor, critics[0], delay_actor=True, loss_function="l2")


def make_loss(name: str, **kwargs):
    loss = OURS[name](
        make_encoder(),
        make_actor(name, "actor_features"),
        make_critics(name, "critic_features"),
        **SETTINGS[name],
        **kwargs,
    )
    loss.make_value_estimator(gamma=0.99)
    return loss


@pytest.mark.parametrize("name", OURS)
def test_losses_equal_torchrls_on_encoded_observations(name):
    torch.manual_seed(0)
    encoder, actor, critics = make_encoder(), make_actor(name, "z"), make_critics(name, "z")
    our_actor, our_critics = make_actor(name, "actor_features"), make_critics(name, "critic_features")
    our_actor.load_state_dict(actor.state_dict())
    for ours, theirs in zip(our_critics, critics, strict=True):
        ours.load_state_dict(theirs.state_dict())
    batch = make_batch()
    encoded = batch.clone()
    for part in (encoded, encoded["next"]):
        part["z"] = encoder(TensorDict({"observation": part["observation"]}, [BATCH]))["z"].detach()
    results = []
    ours = OURS[name](encoder, our_actor, our_critics, **SETTINGS[name])
    for loss, data in ((ours, batch), (torchrls(name, actor, critics), encoded)):
        loss.make_value_estimator(gamma=0.99)
        SoftUpdate(loss, tau=0.01)
        torch.manual_seed(3)
        results.append(loss(data))
        assert data["td_error"].shape == (BATCH,)
    theirs = results[1]
    expected = {"loss_actor": theirs["loss_actor"], "loss_qvalue": theirs.get("loss_qvalue", theirs.get("loss_value"))}
    if name == "sac":
        expected |= {key: theirs[key] for key in ("loss_alpha", "alpha", "entropy")}
    assert set(results[0].keys()) == set(expected)
    for key, value in expected.items():
        torch.testing.assert_close(results[0][key], value, rtol=1e-14, atol=1e-14)
    assert torch.equal(batch["td_error"], encoded["td_error"])


@pytest.mark.parametrize(("name", "passes"), [("sac", 3), ("td3", 2), ("ddpg", 2)])
def test_the_encoder_runs_once_for_each_observation_and_parameter_set(name, passes):
    loss = make_loss(name)
    calls = []
    loss.encoder_network.module.register_forward_hook(lambda *_: calls.append(torch.is_grad_enabled()))
    loss(make_batch())
    assert sorted(calls) == [False] * (passes - 1) + [True]


def gradient_norm(loss, name: str, part: str) -> float:
    torch.manual_seed(1)
    params = [p for n, p in loss.named_parameters() if n.startswith(part)]
    found = torch.autograd.grad(loss(make_batch())[name], params, allow_unused=True)
    return sum(float(g.norm()) for g in found if g is not None)


@pytest.mark.parametrize("name", OURS)
@pytest.mark.parametrize("encoder_grad", ["critic", "actor", "both"])
def test_gradients_reach_the_encoder_from_the_chosen_loss_alone(name, encoder_grad):
    loss = make_loss(name, encoder_grad=encoder_grad)
    assert (gradient_norm(loss, "loss_qvalue", "encoder_network") > 0) == (encoder_grad != "actor")
    assert (gradient_norm(loss, "loss_actor", "encoder_network") > 0) == (encoder_grad != "critic")


def test_torchrls_ddpg_cuts_the_graph_of_what_it_reads():
    # Why its two losses are written again. If this fails, TorchRL has changed, and they need not be any more.
    actor, critics = make_actor("ddpg", "z"), make_critics("ddpg", "z")
    loss = torchrls("ddpg", actor, critics)
    loss.make_value_estimator(gamma=0.99)
    batch = make_batch()
    z = torch.randn(BATCH, FEATURES_N, requires_grad=True)
    batch["z"], batch["next", "z"] = z, torch.randn(BATCH, FEATURES_N)
    losses = loss(batch)
    found = torch.autograd.grad(losses["loss_value"] + losses["loss_actor"], z, allow_unused=True)
    assert found == (None,)


@pytest.mark.parametrize("name", ["sac", "td3"])
def test_the_mean_over_critics_is_half_of_the_sum_of_two(name):
    loss, batch = make_loss(name), make_batch()
    torch.manual_seed(0)
    total = loss(batch.clone())["loss_qvalue"]
    loss.critic_reduction = "mean"
    torch.manual_seed(0)
    torch.testing.assert_close(loss(batch.clone())["loss_qvalue"], total / 2)


@pytest.mark.parametrize("name", ["td3", "ddpg"])
def test_a_normalised_actor_loss_is_divided_by_the_mean_absolute_value(name):
    loss, batch = make_loss(name), make_batch()
    part = "value" if name == "ddpg" else "qvalue"
    with torch.no_grad():
        dict(loss.named_parameters())[f"{part}_network_params.module.net.2.bias"].sub_(50.0)
    plain = loss(batch.clone())["loss_actor"]
    loss.normalise_actor_loss = True
    torch.testing.assert_close(plain / plain, loss(batch.clone())["loss_actor"])  # all values are negative


@pytest.mark.parametrize("name", ["td3", "ddpg"])
def test_the_target_actor_reads_the_target_encoder(name):
    loss, batch = make_loss(name), make_batch()

    def run():
        torch.manual_seed(0)
        return loss(batch.clone()).detach()

    before = run()
    with torch.no_grad():
        for parameter in loss.target_encoder_network_params.values(True, True):
            parameter.data += 0.5
    after = run()
    assert before["loss_qvalue"] != after["loss_qvalue"]
    assert before["loss_actor"] == after["loss_actor"]
    names = {name for name, _ in loss.named_children()}
    assert "target_actor_network_params" in names


@pytest.mark.parametrize("name", OURS)
def test_only_what_terminates_ends_the_return(name):
    loss, batch = make_loss(name, critic_reduction="sum"), make_batch()
    critic_n = 1 if name == "ddpg" else 2
    loss.make_value_estimator(gamma=0.5)
    batch["next", "terminated"] = torch.ones(BATCH, 1, dtype=torch.bool)
    features = loss.encode(batch).detach()
    part = "value_network" if name == "ddpg" else "qvalue_network"
    params = getattr(loss, f"{part}_params").data
    predictions = []
    for index in range(critic_n):
        with (params if name == "ddpg" else params[index]).to_module(getattr(loss, part)):
            predictions.append(getattr(loss, part).module(features, batch["action"]))
    expected = sum((value - batch["next", "reward"]).square().mean() for value in predictions)
    torch.testing.assert_close(loss(batch.clone())["loss_qvalue"].detach(), expected)
    batch["next", "terminated"] = torch.zeros(BATCH, 1, dtype=torch.bool)
    batch["next", "truncated"] = batch["next", "done"] = torch.ones(BATCH, 1, dtype=torch.bool)
    assert not torch.isclose(loss(batch.clone())["loss_qvalue"].detach(), expected)


@pytest.mark.parametrize("name", OURS)
def test_it_can_be_called_with_keywords(name):
    loss, batch = make_loss(name), make_batch()
    torch.manual_seed(0)
    expected = loss(batch.clone())["loss_qvalue"]
    following = {f"next_{key}": batch["next", key] for key in ("observation", "reward", "done", "terminated")}
    torch.manual_seed(0)
    got = dict(
        zip(loss.out_keys, loss(observation=batch["observation"], action=batch["action"], **following), strict=True)
    )
    assert got["loss_qvalue"] == expected


# The settings' algorithms, and batch normalisation in a real encoder.


def algorithm_cfg(name: str, **network):
    cfg = train_cfg()
    return replace(cfg, algorithm=replace(cfg.algorithm, name=name), network=replace(cfg.network, **network))


@pytest.mark.parametrize(
    ("name", "kind"),
    [("tqc", EncodedTQCLoss), ("sac", EncodedSACLoss), ("td3", EncodedTD3Loss), ("ddpg", EncodedDDPGLoss)],
)
def test_settings_choose_the_loss(name, kind):
    cfg = algorithm_cfg(name)
    assert type(build_loss(cfg, build_agent(cfg, env_spec(cfg.env)))) is kind


@pytest.mark.parametrize("name", ["tqc", "td3"])
def test_running_statistics_reach_the_target_encoder(name):
    torch.set_default_dtype(torch.float32)
    torch.manual_seed(0)
    cfg = algorithm_cfg(name, encoder="residual_ocnn", norm="batch")
    agent = build_agent(cfg, env_spec(cfg.env))
    loss = build_loss(cfg, agent)
    targets = TargetUpdate(loss, tau=0.01)

    def statistics(params):
        found = params.data.flatten_keys(".").to_dict()
        return {key: value.clone() for key, value in found.items() if "running" in key or "num_batches" in key}

    fresh = statistics(loss.target_encoder_network_params)
    assert len(fresh) == 3 * sum(isinstance(layer, nn.BatchNorm1d) for layer in agent.encoder.modules())
    loss(transitions(cfg, batch_n=4))
    online, target = statistics(loss.encoder_network_params), statistics(loss.target_encoder_network_params)
    assert all(not torch.equal(online[key], fresh[key]) for key in fresh)
    # One pass, the one on o, moved the online statistics; none moved those of the target.
    assert {int(value) for key, value in online.items() if "num_batches" in key} == {1}
    assert all(torch.equal(target[key], fresh[key]) for key in fresh)
    targets.step()
    target = statistics(loss.target_encoder_network_params)
    assert all(torch.equal(target[key], online[key]) for key in fresh)
    # The policy acts by them too: they are the agent's own.
    assert all(torch.equal(dict(agent.encoder.named_buffers())[key], online[key]) for key in fresh)


def test_torchrls_own_update_leaves_running_statistics_behind():
    torch.set_default_dtype(torch.float32)
    cfg = algorithm_cfg("tqc", encoder="residual_ocnn", norm="batch")
    loss = build_loss(cfg, build_agent(cfg, env_spec(cfg.env)))
    targets = SoftUpdate(loss, tau=0.01)
    loss(transitions(cfg, batch_n=4))
    targets.step()
    target = loss.target_encoder_network_params.data.flatten_keys(".")
    means = [value for key, value in target.items() if key.endswith("running_mean")]
    assert all((mean == 0).all() for mean in means)


def test_running_statistics_can_be_left_behind_as_in_the_thesis():
    torch.set_default_dtype(torch.float32)
    cfg = algorithm_cfg("tqc", encoder="residual_ocnn", norm="batch", target_statistics="initial")
    loss = build_loss(cfg, build_agent(cfg, env_spec(cfg.env)))
    targets = TargetUpdate(loss, tau=0.01, statistics=cfg.network.target_statistics)
    loss(transitions(cfg, batch_n=4))
    targets.step()
    target = loss.target_encoder_network_params.data.flatten_keys(".")
    means = [value for key, value in target.items() if key.endswith("running_mean")]
    assert means
    assert all((mean == 0).all() for mean in means)
