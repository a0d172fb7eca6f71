from __future__ import annotations

import copy
import math

import numpy as np
import pytest
import torch
from tensordict import TensorDict
from tensordict.nn import TensorDictModule
from torch import nn
from torchrl.modules import ProbabilisticActor, TanhNormal, ValueOperator
from torchrl.objectives import SoftUpdate, TQCLoss

from tests.modules import tqc_oracle as oracle
from tests.modules.small_networks import ACTION_N, BATCH, FEATURES_N, make_batch, make_encoder
from tr_grasp.modules import EncodedTQCLoss, GaussianActor, QuantileCritic

pytestmark = pytest.mark.filterwarnings("ignore:No target network updater")

CRITICS_N, QUANTILES_N, DROP = 2, 25, 3


@pytest.fixture(autouse=True)
def _float64():
    torch.set_default_dtype(torch.float64)
    yield
    torch.set_default_dtype(torch.float32)


def make_actor(key: str) -> ProbabilisticActor:
    module = TensorDictModule(GaussianActor(FEATURES_N, ACTION_N, (16,)), in_keys=[key], out_keys=["loc", "scale"])
    return ProbabilisticActor(module, in_keys=["loc", "scale"], distribution_class=TanhNormal)


def make_critics(key: str) -> list[ValueOperator]:
    return [
        ValueOperator(QuantileCritic(FEATURES_N, ACTION_N, QUANTILES_N, hidden_n=(16,)), in_keys=[key, "action"])
        for _ in range(CRITICS_N)
    ]


def make_loss(**kwargs) -> EncodedTQCLoss:
    settings = {"top_quantiles_to_drop_per_net": DROP, "alpha_init": 0.1, "target_entropy": -3.0} | kwargs
    loss = EncodedTQCLoss(make_encoder(), make_actor("actor_features"), make_critics("critic_features"), **settings)
    loss.make_value_estimator(gamma=0.99)
    return loss


def gradient_norm(loss: EncodedTQCLoss, name: str, part: str) -> float:
    params = [p for n, p in loss.named_parameters() if n.startswith(part)]
    gradients = torch.autograd.grad(loss(make_batch())[name], params, allow_unused=True)
    return sum(float(g.norm()) for g in gradients if g is not None)


def test_it_equals_torchrls_loss_on_encoded_observations():
    encoder, actor, critics = make_encoder(), make_actor("z"), make_critics("z")
    ours_actor, ours_critics = make_actor("actor_features"), make_critics("critic_features")
    ours_actor.load_state_dict(actor.state_dict())
    for ours, theirs in zip(ours_critics, critics, strict=True):
        ours.load_state_dict(theirs.state_dict())
    settings = {"top_quantiles_to_drop_per_net": DROP, "alpha_init": 0.1, "target_entropy": -3.0}
    ours = EncodedTQCLoss(encoder, ours_actor, ours_critics, **settings)
    theirs = TQCLoss(actor, critics, num_qvalue_nets=CRITICS_N, deactivate_vmap=True, **settings)
    batch = make_batch()
    encoded = batch.clone()
    for part in (encoded, encoded["next"]):
        part["z"] = encoder(TensorDict({"observation": part["observation"]}, [BATCH]))["z"].detach()
    results = []
    for loss, data in ((ours, batch), (theirs, encoded)):
        loss.make_value_estimator(gamma=0.99)
        SoftUpdate(loss, tau=0.01)
        torch.manual_seed(3)
        results.append(loss(data))
    for name in ("loss_qvalue", "loss_actor", "loss_alpha", "entropy"):
        assert results[0][name] == results[1][name], name


def test_the_encoder_runs_three_times():
    calls = []
    loss = make_loss()
    loss.encoder_network.module.register_forward_hook(lambda *_: calls.append(torch.is_grad_enabled()))
    loss(make_batch())
    assert sorted(calls) == [False, False, True]


def test_features_that_the_caller_encoded_are_used_instead_of_a_pass_over_the_observation():
    loss = make_loss()
    batch = make_batch()
    torch.manual_seed(1)
    expected = loss(batch.clone())
    torch.manual_seed(1)
    got = loss(batch.clone().set("actor_features", loss.encode(batch)))
    for name in expected.keys():  # noqa: SIM118 -- a TensorDict iterates over its batch
        assert expected[name] == got[name]


@pytest.mark.parametrize(
    ("encoder_grad", "from_critic", "from_actor"),
    [("critic", True, False), ("actor", False, True), ("both", True, True)],
)
def test_gradients_reach_the_encoder_from_the_chosen_loss_alone(encoder_grad, from_critic, from_actor):
    loss = make_loss(encoder_grad=encoder_grad)
    assert (gradient_norm(loss, "loss_qvalue", "encoder_network_params") > 0) == from_critic
    assert (gradient_norm(loss, "loss_actor", "encoder_network_params") > 0) == from_actor


def test_each_loss_trains_its_own_network_only():
    loss = make_loss(encoder_grad="both")
    assert gradient_norm(loss, "loss_qvalue", "qvalue_network_params") > 0
    assert gradient_norm(loss, "loss_qvalue", "actor_network_params") == 0
    assert gradient_norm(loss, "loss_actor", "actor_network_params") > 0
    assert gradient_norm(loss, "loss_actor", "qvalue_network_params") == 0
    assert gradient_norm(loss, "loss_alpha", "log_alpha") > 0
    for part in ("actor_network_params", "qvalue_network_params", "encoder_network_params"):
        assert gradient_norm(loss, "loss_alpha", part) == 0


def test_actor_and_encoder_of_the_loss_are_the_callers_parameters():
    encoder, actor = make_encoder(), make_actor("actor_features")
    loss = EncodedTQCLoss(encoder, actor, make_critics("critic_features"))
    inside = {id(p) for p in loss.parameters()}
    assert all(id(p) in inside for p in [*encoder.parameters(), *actor.parameters()])


def test_critics_keep_their_initial_weights():
    critics = make_critics("critic_features")
    first = [copy.deepcopy(critic.module.net[0].weight) for critic in critics]
    loss = EncodedTQCLoss(make_encoder(), make_actor("actor_features"), critics)
    stacked = dict(loss.named_parameters())["qvalue_network_params.module.net.0.weight"]
    assert torch.equal(stacked, torch.stack(first))


def test_a_soft_update_moves_every_target_by_exactly_tau():
    loss = make_loss()
    updater = SoftUpdate(loss, tau=0.25)
    named = {n: p.detach().clone() for n, p in loss.state_dict().items() if n.startswith("target_")}
    assert any(n.startswith("target_encoder") for n in named)
    with torch.no_grad():
        for parameter in loss.parameters():
            parameter += 1.0
    updater.step()
    after = loss.state_dict()
    for name, before in named.items():
        if after[name].is_floating_point() and after[name].ndim:
            torch.testing.assert_close(after[name], before + 0.25, rtol=0, atol=1e-12)


def test_the_mean_over_critics_is_their_sum_divided_by_their_number():
    loss = make_loss()
    batch = make_batch()
    torch.manual_seed(0)
    total = loss(batch)["loss_qvalue"]
    loss.critic_reduction = "mean"
    torch.manual_seed(0)
    torch.testing.assert_close(loss(batch)["loss_qvalue"], total / CRITICS_N)


def test_a_normalised_actor_loss_does_not_change_when_the_values_are_scaled():
    loss = make_loss(normalise_actor_loss=True, alpha_init=1e-12)
    batch = make_batch()
    with torch.no_grad():
        last = dict(loss.named_parameters())["qvalue_network_params.module.net.2.weight"]
        last.mul_(100.0)
    torch.manual_seed(0)
    small = loss(batch)["loss_actor"]
    with torch.no_grad():
        last.mul_(10.0)
        dict(loss.named_parameters())["qvalue_network_params.module.net.2.bias"].mul_(10.0)
    torch.manual_seed(0)
    torch.testing.assert_close(loss(batch)["loss_actor"], small)


def test_the_temperature_does_not_fall_below_its_floor():
    loss = make_loss(alpha_init=0.01, min_alpha=0.05)
    torch.testing.assert_close(loss(make_batch())["alpha"], torch.tensor(0.05))


def test_a_truncated_episode_bootstraps_and_a_terminated_one_does_not():
    loss = make_loss()
    batch = make_batch()
    targets = loss.compute_target(with_features(loss, batch))
    terminated = batch["next", "terminated"].flatten()
    truncated = batch["next", "truncated"].flatten()
    reward = batch["next", "reward"].expand_as(targets)
    assert torch.equal(targets[terminated], reward[terminated])
    assert not torch.isclose(targets[truncated], reward[truncated]).any()


def test_target_critics_read_the_target_encoder_and_nothing_else_does():
    loss = make_loss()
    batch = make_batch()

    def run():
        torch.manual_seed(0)
        return loss(batch.clone()).detach()

    before = run()
    with torch.no_grad():
        for parameter in loss.target_encoder_network_params.values(True, True):
            parameter.data += 0.5
    after = run()
    assert before["loss_qvalue"] != after["loss_qvalue"]
    for name in ("loss_actor", "loss_alpha", "entropy"):
        assert before[name] == after[name]


def with_features(loss: EncodedTQCLoss, batch: TensorDict) -> TensorDict:
    batch = batch.clone()
    batch["next"] = loss._encode_next(batch["next"])
    batch["actor_features"] = batch["critic_features"] = loss.encode(batch).detach()
    return batch


# From here on, critics are tables: the "features" are the quantiles themselves.


class Table(nn.Module):
    """Critic number ``index`` reads its quantiles off the features."""

    def __init__(self, index: int, quantiles_n: int, features_n: int, action_n: int) -> None:
        super().__init__()
        self.select = nn.Linear(features_n + action_n, quantiles_n, bias=False)
        weight = torch.zeros(quantiles_n, features_n + action_n)
        weight[:, index * quantiles_n : (index + 1) * quantiles_n] = torch.eye(quantiles_n)
        self.select.weight = nn.Parameter(weight)

    def forward(self, features, action):
        return self.select(torch.cat([features, action], dim=-1))


def table_loss(quantiles_n, critics_n, *, drop, alpha, gamma=0.99, action_n=7, target_entropy=-7.0) -> EncodedTQCLoss:
    n = quantiles_n * critics_n
    identity = nn.Linear(n, n, bias=False)
    identity.weight = nn.Parameter(torch.eye(n))
    actor = ProbabilisticActor(
        TensorDictModule(GaussianActor(n, action_n, ()), in_keys=["actor_features"], out_keys=["loc", "scale"]),
        in_keys=["loc", "scale"],
        distribution_class=TanhNormal,
    )
    critics = [
        ValueOperator(Table(c, quantiles_n, n, action_n), in_keys=["critic_features", "action"])
        for c in range(critics_n)
    ]
    encoder = TensorDictModule(identity, in_keys=["observation"], out_keys=["z"])
    loss = EncodedTQCLoss(
        encoder, actor, critics, top_quantiles_to_drop_per_net=drop, alpha_init=alpha, target_entropy=target_entropy
    )
    loss.make_value_estimator(gamma=gamma)
    return loss


def table_batch(now, following, reward, terminated, action_n=7) -> TensorDict:
    now, following = torch.as_tensor(now).flatten(1), torch.as_tensor(following).flatten(1)
    end = torch.as_tensor(terminated, dtype=torch.bool)[:, None]
    return TensorDict(
        {
            "observation": now,
            "action": torch.zeros(len(now), action_n),
            "next": {
                "observation": following,
                "reward": torch.as_tensor(reward)[:, None],
                "terminated": end,
                "done": torch.ones_like(end),
            },
        },
        batch_size=[len(now)],
    )


@pytest.fixture
def fix_log_prob(monkeypatch):
    """Make every sampled action score a given log-probability."""

    def fix(log_prob):
        value = torch.as_tensor(log_prob)

        def sample(distribution):
            return distribution.loc, value + 0.0 * distribution.loc.sum(-1)

        monkeypatch.setattr("torchrl.objectives.tqc.compute_rsample_log_prob", sample)
        monkeypatch.setattr("tr_grasp.modules.losses.stochastic.compute_rsample_log_prob", sample)

    return fix


POOLED = [[[1.0, 2.0, 3.0], [10.0, 11.0, 12.0]]]


def targets_of(loss, batch):
    return loss.compute_target(with_features(loss, batch))


@pytest.mark.parametrize(
    ("terminated", "expected"), [(True, [0.7] * 4), (False, [1.987, 2.977, 3.967, 10.897])], ids=["end", "goes on"]
)
def test_top_atoms_are_dropped_from_the_pooled_set(fix_log_prob, terminated, expected):
    # A cut in each critic would keep 1, 2, 10, 11; the pooled cut keeps 1, 2, 3, 10.
    fix_log_prob([-3.0])
    loss = table_loss(3, 2, drop=1, alpha=0.1)
    targets = targets_of(loss, table_batch(POOLED, POOLED, [0.7], [terminated]))
    torch.testing.assert_close(targets, torch.tensor([expected]))


def test_without_a_drop_all_atoms_stay(fix_log_prob):
    fix_log_prob([0.0])
    loss = table_loss(3, 2, drop=0, alpha=0.1)
    assert targets_of(loss, table_batch(POOLED, POOLED, [0.0], [False])).shape == (1, 6)


@pytest.mark.parametrize(("target", "expected"), [(0.5, 0.0625), (2.0, 0.75), (-2.0, 0.75), (1.0, 0.25), (0.0, 0.0)])
def test_one_quantile_against_one_atom(fix_log_prob, target, expected):
    fix_log_prob([0.0])
    loss = table_loss(1, 1, drop=0, alpha=0.1)
    batch = table_batch([[[0.0]]], [[[0.0]]], [target], [True])
    torch.testing.assert_close(loss(batch)["loss_qvalue"], torch.tensor(expected))


@pytest.mark.parametrize("target", [2.0, -2.0])
def test_two_quantiles_against_one_atom(fix_log_prob, target):
    fix_log_prob([0.0])
    loss = table_loss(2, 1, drop=0, alpha=0.1)
    batch = table_batch([[[0.0, 0.0]]], [[[0.0, 0.0]]], [target], [True])
    torch.testing.assert_close(loss(batch)["loss_qvalue"], torch.tensor(0.75))


def test_the_actor_sees_the_whole_mixture(fix_log_prob):
    fix_log_prob([-2.0])
    loss = table_loss(3, 2, drop=1, alpha=0.1)
    torch.testing.assert_close(loss(table_batch(POOLED, POOLED, [0.0], [True]))["loss_actor"], torch.tensor(-6.7))


@pytest.mark.parametrize(("log_prob", "expected"), [(-3.0, -23.025850929940454), (9.0, 4.605170185988091)])
def test_the_temperature_rises_when_entropy_is_too_low(fix_log_prob, log_prob, expected):
    fix_log_prob([log_prob])
    loss = table_loss(3, 2, drop=1, alpha=0.1, target_entropy=-7.0)
    torch.testing.assert_close(loss(table_batch(POOLED, POOLED, [0.0], [True]))["loss_alpha"], torch.tensor(expected))


def test_it_agrees_with_the_oracle_and_with_recorded_numbers(fix_log_prob):
    rng = np.random.default_rng(0)
    now, following = rng.normal(size=(4, 2, 25)), 3 * rng.normal(size=(4, 2, 25))
    log_prob, reward = rng.normal(size=4), rng.normal(size=4)
    terminated = np.array([0.0, 1.0, 0.0, 0.0])
    fix_log_prob(log_prob)
    loss = table_loss(25, 2, drop=3, alpha=0.1)
    batch = table_batch(now, following, reward, terminated)
    atoms = oracle.target_atoms(following, log_prob, reward, terminated, 0.99, 0.1, 3)
    np.testing.assert_allclose(targets_of(loss, batch).numpy(), atoms, rtol=1e-14)
    assert atoms.shape == (4, 44)
    assert math.isclose(atoms.sum(), -133.07823035048122, rel_tol=1e-12)
    losses = loss(batch).detach()
    expected = oracle.quantile_huber(now, atoms).sum(1).mean()
    assert math.isclose(expected, 1.6025499545288504, rel_tol=1e-12)
    assert math.isclose(float(losses["loss_qvalue"]), expected, rel_tol=1e-12)
    assert math.isclose(float(losses["loss_actor"]), oracle.actor_loss(now, log_prob, 0.1), rel_tol=1e-9)
    assert math.isclose(float(losses["loss_actor"]), 0.007321218793327616, rel_tol=1e-9)
    expected_alpha = oracle.alpha_loss(math.log(0.1), log_prob, -7.0)
    assert math.isclose(float(losses["loss_alpha"]), expected_alpha, rel_tol=1e-12)


@pytest.mark.parametrize("reduction", ["sum", "mean"])
@pytest.mark.parametrize("normalise", [False, True])
@pytest.mark.parametrize(("critics_n", "quantiles_n", "drop"), [(2, 25, 3), (1, 5, 0), (3, 7, 6)])
@pytest.mark.parametrize("seed", range(3))
def test_it_agrees_with_the_oracle_on_fresh_inputs(
    fix_log_prob, seed, critics_n, quantiles_n, drop, normalise, reduction
):
    rng = np.random.default_rng(100 + seed)
    batch_n, alpha, gamma = 9, rng.uniform(0.01, 1), rng.uniform(0.5, 0.999)
    now, following = (s * rng.normal(size=(batch_n, critics_n, quantiles_n)) for s in (1, 3))
    log_prob, reward = rng.normal(size=batch_n), 3 * rng.normal(size=batch_n)
    terminated, truncated = (rng.random((2, batch_n)) < 0.5).astype(float)
    fix_log_prob(log_prob)
    loss = table_loss(quantiles_n, critics_n, drop=drop, alpha=alpha, gamma=gamma)
    loss.critic_reduction, loss.normalise_actor_loss = reduction, normalise
    batch = table_batch(now, following, reward, terminated)
    # What is cut short goes on from the oracle's point of view: only an end ends the return.
    batch["next", "truncated"] = torch.as_tensor(truncated, dtype=torch.bool)[:, None]
    batch["next", "done"] = batch["next", "truncated"] | batch["next", "terminated"]
    atoms = oracle.target_atoms(following, log_prob, reward, terminated, gamma, alpha, drop)
    losses = loss(batch).detach()

    per_critic = oracle.quantile_huber(now, atoms)
    expected = (per_critic.sum(1) if reduction == "sum" else per_critic.mean(1)).mean()
    assert abs(float(losses["loss_qvalue"]) - expected) <= 1e-12 * max(1.0, expected)
    size = max(0.3, np.abs(now.mean((1, 2))).mean()) if normalise else 1.0
    assert abs(float(losses["loss_actor"]) - oracle.actor_loss(now, log_prob, alpha) / size) <= 1e-12
    assert abs(float(losses["loss_alpha"]) - oracle.alpha_loss(math.log(alpha), log_prob, -7.0)) <= 1e-11


def test_it_can_be_called_with_keywords():
    loss = make_loss()
    batch = make_batch()
    torch.manual_seed(0)
    expected = loss(batch)["loss_qvalue"]
    torch.manual_seed(0)
    following = {f"next_{name}": batch["next", name] for name in ("observation", "reward", "done", "terminated")}
    got = dict(
        zip(loss.out_keys, loss(observation=batch["observation"], action=batch["action"], **following), strict=True)
    )
    assert got["loss_qvalue"] == expected
