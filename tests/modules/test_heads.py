from __future__ import annotations

import torch

from tr_grasp.modules import GaussianActor, QuantileCritic
from tr_grasp.modules.heads import LOG_STD_RANGE


def test_the_actor_splits_its_output_into_mean_and_clamped_deviation():
    actor = GaussianActor(2, 3, ())
    with torch.no_grad():
        actor.net[0].weight.zero_()
        actor.net[0].bias.copy_(torch.tensor([1.0, 2.0, 3.0, 0.0, -100.0, 100.0]))
    mean, std = actor(torch.zeros(4, 2))
    assert torch.equal(mean, torch.tensor([1.0, 2.0, 3.0]).expand(4, 3))
    low, high = LOG_STD_RANGE
    torch.testing.assert_close(std[0], torch.tensor([0.0, low, high]).exp())


def test_a_critic_reads_features_then_stages_then_action():
    critic = QuantileCritic(2, 1, 5, stages_n=4, hidden_n=(8,), layer_norm=True)
    features, stages, action = torch.randn(3, 2), torch.randn(3, 4), torch.randn(3, 1)
    assert critic(features, stages, action).shape == (3, 5)
    assert torch.equal(critic(features, stages, action), critic.net(torch.cat([features, stages, action], dim=1)))
    assert sum(isinstance(layer, torch.nn.LayerNorm) for layer in critic.net) == 1
