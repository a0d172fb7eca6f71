from __future__ import annotations

from collections.abc import Callable

import pytest
import torch
from torch import nn

from tr_grasp.modules import (
    DenseResidualMLP,
    DeterministicActor,
    DuelingQuantileCritic,
    GaussianActor,
    QuantileCritic,
)
from tr_grasp.modules.heads import LOG_STD_RANGE, MLP, ConcatLinear, OutputScale, mlp
from tr_grasp.modules.heads.critics import action_points

FEATURES_N, ACTION_N = 510, 5


def parameters_n(module: nn.Module) -> int:
    return sum(parameter.numel() for parameter in module.parameters())


def dense(width: int, blocks_n: int = 2, **kwargs) -> Callable[[int, int], nn.Module]:
    return lambda in_n, out_n: DenseResidualMLP(in_n, out_n, width, blocks_n, **kwargs)


@pytest.mark.parametrize(
    ("head", "expected"),
    [
        (lambda: GaussianActor(FEATURES_N, ACTION_N, (512, 512)), 529_418),
        (lambda: QuantileCritic(FEATURES_N, ACTION_N, hidden_n=(512, 512)), 539_673),
        (lambda: GaussianActor(FEATURES_N, ACTION_N, make_net=dense(256)), 659_210),
        (lambda: GaussianActor(FEATURES_N, ACTION_N, make_net=dense(512)), 1_842_698),
        (lambda: DuelingQuantileCritic(FEATURES_N, ACTION_N, make_net=dense(256)), 1_329_970),
        (lambda: DuelingQuantileCritic(FEATURES_N, ACTION_N, make_net=dense(256, spectral_norm=True)), 1_329_970),
    ],
    ids=["vanilla actor", "vanilla critic", "actor 256", "actor 512", "dueling critic", "dueling critic, normalised"],
)
def test_a_head_on_the_features_of_the_thesis_has_so_many_parameters(head, expected):
    assert parameters_n(head()) == expected


def test_the_actor_splits_its_output_into_mean_and_clamped_deviation():
    actor = GaussianActor(2, 3, ())
    with torch.no_grad():
        actor.net[0].weight.zero_()
        actor.net[0].bias.copy_(torch.tensor([1.0, 2.0, 3.0, 0.0, -100.0, 100.0]))
    mean, std = actor(torch.zeros(4, 2))
    assert torch.equal(mean, torch.tensor([1.0, 2.0, 3.0]).expand(4, 3))
    assert torch.equal(actor.mean(torch.zeros(4, 2)), mean)
    low, high = LOG_STD_RANGE
    torch.testing.assert_close(std[0], torch.tensor([0.0, low, high]).exp())


@pytest.mark.parametrize("make_net", [None, dense(8)])
def test_the_initial_deviation_is_set_at_the_output_of_any_network(make_net):
    torch.manual_seed(0)
    zero = GaussianActor(4, 2, (8,), 0.0, make_net=make_net)
    torch.manual_seed(0)
    small = GaussianActor(4, 2, (8,), -1.5, make_net=make_net)
    features = torch.randn(3, 4)
    for (mean, std), scale in ((zero(features), 1.0), (small(features), torch.tensor(-1.5).exp())):
        torch.testing.assert_close(mean, zero.mean(features))
        torch.testing.assert_close(std, zero(features)[1] * scale)


def test_the_deterministic_actor_gives_a_mean_alone():
    actor = DeterministicActor(4, 2, (8,))
    features = torch.randn(3, 4)
    assert actor(features).shape == (3, 2)
    assert torch.equal(actor(features), actor.mean(features))


def test_a_critic_reads_features_then_stages_then_action():
    critic = QuantileCritic(2, 1, 5, stages_n=4, hidden_n=(8,), layer_norm=True)
    features, stages, action = torch.randn(3, 2), torch.randn(3, 4), torch.randn(3, 1)
    assert critic(features, stages, action).shape == (3, 5)
    assert torch.equal(critic(features, stages, action), critic.net(torch.cat([features, stages, action], dim=1)))
    assert sum(isinstance(layer, nn.LayerNorm) for layer in critic.net) == 1


@pytest.mark.parametrize("make", [lambda: mlp(7, (8, 8), 3), lambda: DenseResidualMLP(7, 3, 8)])
def test_inputs_that_broadcast_give_what_their_expanded_concatenation_gives(make):
    net = make()
    state, actions = torch.randn(4, 1, 5), torch.randn(6, 2)
    expected = net(torch.cat([state.expand(4, 6, 5), actions.expand(4, 6, 2)], dim=-1))
    torch.testing.assert_close(net(state, actions), expected)


def test_a_concat_linear_of_one_input_is_a_linear_layer():
    layer = ConcatLinear(3, 2)
    x = torch.randn(4, 3)
    assert torch.equal(layer(x), nn.functional.linear(x, layer.weight, layer.bias))
    assert isinstance(mlp(3, (4,), 2), MLP)


def test_a_dense_residual_network_is_its_definition():
    torch.manual_seed(0)
    net = DenseResidualMLP(4, 3, 8, 2)
    x = torch.randn(5, 4)
    h = (net.input.weight @ x.T + net.input.bias[:, None]).clamp(min=0).T
    for block in net.blocks:
        normal = (h - h.mean(1, keepdim=True)) / (h.var(1, unbiased=False, keepdim=True) + 1e-5).sqrt()
        read = torch.cat([normal * block.norm.weight + block.norm.bias, x], dim=1)
        h = h + (read @ block.a.weight.T + block.a.bias).clamp(min=0) @ block.b.weight.T + block.b.bias
    normal = (h - h.mean(1, keepdim=True)) / (h.var(1, unbiased=False, keepdim=True) + 1e-5).sqrt()
    expected = (normal * net.norm.weight + net.norm.bias) @ net.output.weight.T + net.output.bias
    torch.testing.assert_close(net(x), expected)


@pytest.mark.parametrize("make_net", [None, dense(8)])
def test_a_dueling_critic_is_its_definition_one_point_after_the_other(make_net):
    torch.manual_seed(0)
    critic = DuelingQuantileCritic(3, 2, 5, stages_n=1, hidden_n=(8,), make_net=make_net)
    features, stages, action = torch.randn(4, 3), torch.randn(4, 1), torch.rand(4, 2) * 2 - 1
    state = torch.cat([features, stages], dim=1)

    def advantage(a):
        return critic.advantage(torch.cat([state, a.expand(4, 2)], dim=1))

    mean = sum(advantage(point) for point in critic.points) / 16
    torch.testing.assert_close(critic(features, stages, action), critic.value(state) + advantage(action) - mean)


def test_the_value_of_a_dueling_critic_is_its_mean_over_the_points():
    critic = DuelingQuantileCritic(3, 2, 5, hidden_n=(8,))
    features = torch.randn(4, 3)
    at_points = torch.stack([critic(features, point.expand(4, 2)) for point in critic.points])
    torch.testing.assert_close(at_points.mean(0), critic.value(features))


def test_the_slope_of_a_dueling_critic_in_the_action_is_that_of_its_advantage():
    critic = DuelingQuantileCritic(3, 2, 5, hidden_n=(8,))
    features, action = torch.randn(4, 3), (torch.rand(4, 2) * 2 - 1).requires_grad_()
    (slope,) = torch.autograd.grad(critic(features, action).sum(), action)
    (expected,) = torch.autograd.grad(critic.advantage(features, action).sum(), action)
    torch.testing.assert_close(slope, expected)
    assert slope.abs().sum() > 0


def test_the_points_fill_the_actions_evenly_and_are_the_same_in_every_critic():
    points = action_points(16, 5)
    assert torch.equal(points, DuelingQuantileCritic(3, 5, 2, hidden_n=()).points)
    assert points.abs().max() < 1
    torch.testing.assert_close(points.mean(0), torch.zeros(5))
    for column in points.T:
        cells = torch.linspace(-1 + 1 / 16, 1 - 1 / 16, 16)
        torch.testing.assert_close(column.sort().values, cells)


@pytest.mark.parametrize("learned", [False, True])
def test_the_output_scale_multiplies_everything_and_is_a_parameter_only_if_it_is_learned(learned):
    torch.manual_seed(0)
    plain = QuantileCritic(3, 2, 5, hidden_n=(8,))
    torch.manual_seed(0)
    scaled = QuantileCritic(3, 2, 5, hidden_n=(8,), scale=OutputScale(100.0, learned))
    features, action = torch.randn(4, 3), torch.randn(4, 2)
    torch.testing.assert_close(scaled(features, action), 100 * plain(features, action))
    assert parameters_n(scaled) - parameters_n(plain) == learned
