from __future__ import annotations

import pytest
import torch
from tensordict import TensorDict, TensorDictParams
from tensordict.nn import TensorDictModule
from torch import nn
from torchrl.objectives import LossModule, SoftUpdate

from tests.octree.clouds import SPEC, random_frames
from tr_grasp.modules.encoders import ResidualOCNN, build_encoder, copy_statistics
from tr_grasp.modules.encoders.norm import NodeBatchNorm, norm_layer


def running_means(module: nn.Module) -> list[torch.Tensor]:
    return [buffer for name, buffer in module.named_buffers() if name.endswith("running_mean")]


def encode(encoder: nn.Module, seed: int = 0, batch_n: int = 3) -> torch.Tensor:
    return encoder(random_frames(batch_n, seed), torch.zeros(batch_n, 10))


@pytest.mark.parametrize("norm", ["group", "layer"])
def test_group_and_layer_normalise_each_node_alone(norm: str) -> None:
    x = torch.randn(5, 32) * 3 + 2
    y = norm_layer(norm)(32)(x)
    groups = y.view(5, 4, 8) if norm == "group" else y
    torch.testing.assert_close(groups.mean(-1), torch.zeros(groups.shape[:-1]), atol=1e-5, rtol=0)
    torch.testing.assert_close(groups.var(-1, correction=0), torch.ones(groups.shape[:-1]), atol=1e-3, rtol=0)


def test_batch_normalises_each_channel_over_all_nodes_and_remembers_a_share_of_the_statistics() -> None:
    norm = norm_layer("batch", momentum=0.25)(4)
    x = torch.randn(500, 4) * 3 + 2
    y = norm(x)
    torch.testing.assert_close(y.mean(0), torch.zeros(4), atol=1e-5, rtol=0)
    torch.testing.assert_close(norm.running_mean, 0.25 * x.mean(0))
    torch.testing.assert_close(norm.running_var, 0.75 + 0.25 * x.var(0))
    expected = (x - norm.running_mean) / (norm.running_var + norm.eps).sqrt()
    torch.testing.assert_close(norm.eval()(x), expected)


@pytest.mark.parametrize("nodes_n", [0, 1])
def test_a_batch_without_variance_is_normalised_by_what_came_before(nodes_n: int) -> None:
    norm = NodeBatchNorm(4)
    norm(torch.randn(50, 4))
    x, before = torch.randn(nodes_n, 4), norm.running_mean.clone()
    trained = norm(x)
    assert torch.equal(norm.running_mean, before)
    assert torch.equal(trained, norm.eval()(x))


def test_only_training_changes_the_statistics_of_an_encoder() -> None:
    encoder = ResidualOCNN(SPEC, norm="batch", norm_momentum=0.5)
    encoder.eval()
    fresh = encode(encoder)
    assert not any(mean.any() for mean in running_means(encoder))
    encoder.train()
    trained = encode(encoder)
    assert all(mean.any() for mean in running_means(encoder))
    before = [mean.clone() for mean in running_means(encoder)]
    assert not torch.allclose(encode(encoder.eval()), fresh)
    assert not torch.allclose(trained, fresh)
    assert all(map(torch.equal, before, running_means(encoder)))


def test_the_momentum_reaches_every_layer() -> None:
    encoder = build_encoder("o_ahrnet", norm="batch", norm_momentum=0.3)
    assert {m.momentum for m in encoder.modules() if isinstance(m, NodeBatchNorm)} == {0.3}


def test_statistics_survive_saving() -> None:
    encoder, other = (ResidualOCNN(SPEC, norm="batch") for _ in range(2))
    encode(encoder)
    other.load_state_dict(encoder.state_dict())
    assert torch.equal(encode(other.eval()), encode(encoder.eval()))


class EncoderLoss(LossModule):
    """The part of a loss that holds an encoder and its target."""

    encoder_network: TensorDictModule
    encoder_network_params: TensorDictParams
    target_encoder_network_params: TensorDictParams

    def __init__(self, encoder: nn.Module) -> None:
        super().__init__()
        network = TensorDictModule(encoder, in_keys=["octree", "proprio"], out_keys=["features"])
        self.convert_to_functional(network, "encoder_network", create_target_params=True)

    def encode(self, observation: TensorDict, params: TensorDictParams) -> torch.Tensor:
        with params.to_module(self.encoder_network, preserve_module_state=False):
            return self.encoder_network(observation.copy())["features"]


@pytest.mark.filterwarnings("ignore:No target network updater")
def test_target_updaters_forget_statistics_and_copy_statistics_brings_them() -> None:
    encoder = ResidualOCNN(SPEC, norm="batch", norm_momentum=0.5)
    loss = EncoderLoss(encoder)
    updater = SoftUpdate(loss, tau=0.5)
    observation = TensorDict(octree=random_frames(3), proprio=torch.zeros(3, 10), batch_size=[3])
    online, target = loss.encoder_network_params, loss.target_encoder_network_params
    loss.encode(observation, online)
    updater.step()
    encoder.eval()
    assert not torch.allclose(loss.encode(observation, target), loss.encode(observation, online))
    copy_statistics(online, target)
    torch.testing.assert_close(loss.encode(observation, target), loss.encode(observation, online))
    copied = target.get(("module", "squeeze_norm", "running_mean"))
    encoder.train()
    loss.encode(observation, online)
    assert not torch.equal(copied, running_means(encoder)[-1])


def test_copying_statistics_leaves_parameters_alone() -> None:
    online, target = (TensorDict.from_module(NodeBatchNorm(2)) for _ in range(2))
    online["weight"].data.fill_(7.0)
    online["running_mean"].fill_(3.0)
    copy_statistics(online, target)
    assert target["weight"].tolist() == [1.0, 1.0]
    assert target["running_mean"].tolist() == [3.0, 3.0]
