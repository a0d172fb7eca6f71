from __future__ import annotations

import math

import torch

from tr_grasp.modules import imitation_loss


def test_a_case_by_hand():
    # One motion is 0.5 off: Huber(0.3) = 0.3 * (0.5 - 0.15) = 0.105, times 2.
    # The gripper's logit is 0: ln 2, times 0.3.
    mean = torch.zeros(1, 5)
    expert = torch.tensor([[0.5, 0.0, 0.0, 0.0, 1.0]])
    expected = 2 * 0.105 + 0.3 * math.log(2)
    assert math.isclose(float(imitation_loss(mean, expert, torch.ones(1))), expected, rel_tol=1e-6)


def test_the_gripper_is_classified_by_its_sign_with_soft_targets():
    mean = torch.zeros(1, 5, requires_grad=True)
    imitation_loss(mean, torch.tensor([[0.0, 0.0, 0.0, 0.0, -0.1]]), torch.ones(1)).backward()
    # d/dm of 0.3 * BCE(3 m, 0.02) at m = 0 is 0.3 * 3 * (0.5 - 0.02).
    torch.testing.assert_close(mean.grad[0], torch.tensor([0.0, 0.0, 0.0, 0.0, 0.3 * 3 * 0.48]))


def test_samples_without_weight_do_not_count():
    mean, expert = torch.randn(4, 5), torch.rand(4, 5) * 2 - 1
    weight = torch.tensor([1.0, 0.0, 1.0, 0.0])
    kept = imitation_loss(mean[::2], expert[::2], torch.ones(2))
    torch.testing.assert_close(imitation_loss(mean, expert, weight), kept)


def test_no_weight_at_all_is_no_loss_and_no_gradient():
    mean = torch.randn(3, 5, requires_grad=True)
    loss = imitation_loss(mean, torch.zeros(3, 5), torch.zeros(3))
    loss.backward()
    assert loss == 0
    assert not mean.grad.any()
