from __future__ import annotations

import copy
import pickle
from dataclasses import replace
from itertools import pairwise

import pytest
import torch
from torch import nn

from tests.modules.transitions import transitions
from tests.toy_env import env_spec, train_cfg
from tr_grasp.modules import DenseResidualMLP, SpectralNorm, TargetUpdate, build_agent, build_loss
from tr_grasp.modules.heads import normalise_kernels
from tr_grasp.octree import OctreeConv, OctreeDeconv


def largest_singular_value(weight: torch.Tensor) -> float:
    return float(torch.linalg.matrix_norm(weight.detach().flatten(0, -2), 2))


def warm(layer: SpectralNorm, passes: int = 100) -> SpectralNorm:
    for _ in range(passes):
        layer._iterate()
    return layer


@pytest.mark.parametrize("layer", [nn.Linear(6, 9), OctreeConv(3, 4), OctreeDeconv(2, 5), OctreeConv(3, 4, kernel=1)])
def test_the_divided_weight_has_largest_singular_value_one(layer):
    torch.manual_seed(0)
    normalised = warm(SpectralNorm(layer))
    assert largest_singular_value(normalised.weight) == pytest.approx(1.0, abs=1e-4)
    torch.testing.assert_close(normalised.weight * largest_singular_value(layer.weight), layer.weight)


def test_a_layer_divides_by_hand():
    layer = nn.Linear(2, 2, bias=False)
    with torch.no_grad():
        layer.weight.copy_(torch.diag(torch.tensor([4.0, 1.0])))
    normalised = warm(SpectralNorm(layer)).eval()
    torch.testing.assert_close(normalised(torch.tensor([[1.0, 1.0]])), torch.tensor([[1.0, 0.25]]))


def test_it_agrees_with_torchs_own_in_value_and_gradient():
    torch.manual_seed(0)
    layer = nn.Linear(6, 9)
    ours = warm(SpectralNorm(copy.deepcopy(layer))).eval()
    theirs = nn.utils.parametrizations.spectral_norm(layer, n_power_iterations=100).eval()
    x = torch.randn(4, 6)
    torch.testing.assert_close(ours(x), theirs(x))
    ours(x).square().sum().backward()
    theirs(x).square().sum().backward()
    torch.testing.assert_close(ours.layer.weight.grad, layer.parametrizations.weight.original.grad)


def test_vectors_move_in_training_and_stand_still_in_evaluation():
    torch.manual_seed(0)
    layer = SpectralNorm(nn.Linear(6, 9))
    with torch.no_grad():
        layer.layer.weight.copy_(torch.randn(9, 6))
    before = layer.u.clone()
    layer.eval()(torch.randn(2, 6))
    assert torch.equal(layer.u, before)
    layer.train()(torch.randn(2, 6))
    assert not torch.equal(layer.u, before)


def test_two_passes_before_one_backward_are_fine():
    layer = SpectralNorm(nn.Linear(3, 3))
    (layer(torch.randn(2, 3)).sum() + layer(torch.randn(2, 3)).sum()).backward()
    assert layer.layer.weight.grad is not None


def test_it_can_be_copied_and_pickled_after_use():
    layer = SpectralNorm(nn.Linear(3, 4))
    layer(torch.randn(2, 3)).sum().backward()
    x = torch.randn(2, 3)
    expected = layer.eval()(x)
    for other in (copy.deepcopy(layer), pickle.loads(pickle.dumps(layer))):
        assert torch.equal(other(x), expected)
    assert set(layer.state_dict()) == {"layer.weight", "layer.bias", "u", "v"}
    assert layer.in_features == 3  # whatever else is asked of it, its layer answers


def test_only_linear_layers_and_octree_convolutions_are_normalised():
    module = nn.Sequential(nn.Linear(3, 3), nn.LayerNorm(3), nn.Sequential(OctreeConv(2, 2), nn.BatchNorm1d(2)))
    normalise_kernels(module)
    normalise_kernels(module)  # once is enough
    kinds = [type(layer) for layer in module.modules()]
    assert kinds.count(SpectralNorm) == 2
    assert isinstance(module[1], nn.LayerNorm)
    assert not isinstance(module[0].layer, SpectralNorm)


def network_cfg(**network):
    cfg = train_cfg()
    return replace(cfg, network=replace(cfg.network, heads="advanced", residual_width=16, **network))


@pytest.mark.parametrize(
    ("where", "critic", "actor", "encoder"),
    [("none", 0, 0, 0), ("critic", 8, 0, 0), ("actor_critic", 8, 4, 0), ("all", 8, 4, None)],
)
def test_each_part_is_normalised_where_the_setting_says(where, critic, actor, encoder):
    cfg = network_cfg(spectral_norm=where)
    agent = build_agent(cfg, env_spec(cfg.env))

    def count(part):
        return sum(isinstance(layer, SpectralNorm) for layer in part.modules())

    assert (count(agent.critics[0]), count(agent.actor)) == (critic, actor)
    kernels = sum(isinstance(layer, nn.Linear | OctreeConv | OctreeDeconv) for layer in agent.encoder.modules())
    assert count(agent.encoder) == (kernels if encoder is None else encoder)
    for net in (agent.critics[0].module.value, agent.actor.module[0].module.net):
        assert not any(isinstance(layer, SpectralNorm) for layer in (net.input, net.output, net.norm))


@pytest.mark.filterwarnings("ignore:No target network updater")
def test_a_target_network_has_vectors_that_fit_its_own_weights():
    torch.manual_seed(0)
    cfg = network_cfg(spectral_norm="all", norm="none", encoder="state_mlp")
    agent = build_agent(cfg, env_spec(cfg.env))
    loss = build_loss(cfg, agent)
    targets = TargetUpdate(loss, tau=0.02)
    batch = transitions(cfg, batch_n=4)
    with torch.no_grad():
        for _ in range(60):
            for name, parameter in loss.named_parameters():
                if name.endswith(".weight") and parameter.ndim >= 2:
                    parameter += 0.05 * torch.randn_like(parameter)
            loss(batch.clone())
            targets.step()
    checked = 0
    for prefix in ("", "target_"):
        for part in ("encoder_network", "qvalue_network"):
            params = dict(getattr(loss, f"{prefix}{part}_params").data.flatten_keys(".").items())
            for name in [name.removesuffix(".u") for name in params if name.endswith(".u")]:
                weight, u, v = (params[f"{name}.{key}"] for key in ("layer.weight", "u", "v"))
                weights = [(weight, u, v)] if u.ndim == 1 else list(zip(weight, u, v, strict=True))
                for w, left, right in weights:
                    sigma = float(left @ w.flatten(0, -2) @ right)
                    assert sigma == pytest.approx(largest_singular_value(w), rel=0.06), f"{prefix}{part} {name}"
                    checked += 1
    assert checked == 2 * (2 + 2 * 8)
    online, target = (getattr(loss, f"{p}qvalue_network_params").flatten_keys(".") for p in ("", "target_"))
    moved = [not torch.equal(online[key], target[key]) for key in online.keys() if key.endswith(".u")]  # noqa: SIM118
    assert all(moved)


def test_blocks_whose_matrices_are_normalised_have_a_bounded_slope():
    # Each block adds at most 1 to the slope with respect to its normalised input, whatever the weights are.
    torch.manual_seed(0)
    net = DenseResidualMLP(6, 4, 16, 3, spectral_norm=True)
    with torch.no_grad():
        for parameter in net.parameters():
            parameter.mul_(50.0)
    for block in net.blocks:
        warm(block.a), warm(block.b)
        bound = largest_singular_value(block.a.weight) * largest_singular_value(block.b.weight)
        assert bound == pytest.approx(1.0, abs=1e-3)
        block.eval()
        h, x = torch.randn(200, 16), torch.randn(200, 6)
        read = torch.cat([block.norm(h), x], dim=1)
        out = block(h, x)
        for (r, o), (r_next, o_next) in pairwise(zip(read, out, strict=True)):
            assert (o - o_next).norm() <= (r - r_next).norm() * 1.001
