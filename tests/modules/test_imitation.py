from __future__ import annotations

import math

import pytest
import torch

from tr_grasp.modules import imitation_loss
from tr_grasp.modules.imitation import localisation_loss


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


def test_localisation_compares_offsets_in_tenths_of_a_metre_and_the_double_turn():
    target = torch.tensor([[0.05, 0.0, -0.1, 1.0, 0.0, 1.0]])
    exact = torch.tensor([[0.5, 0.0, -1.0, 1.0, 0.0]])
    assert localisation_loss(exact, target, torch.ones(1)).item() == pytest.approx(0.0, abs=1e-12)
    off = exact.clone()
    off[0, 1] = 0.2  # 2 cm: Huber of 0.2 with delta 0.5 is 0.02, the mean of five numbers 0.004
    assert localisation_loss(off, target, torch.ones(1)).item() == pytest.approx(0.004)


def test_localisation_leaves_out_what_has_no_weight_or_no_target():
    target = torch.zeros(3, 6)
    target[1:, 5] = 1.0
    prediction = torch.full((3, 5), 9.0, requires_grad=True)
    localisation_loss(prediction, target, torch.tensor([1.0, 0.0, 1.0])).backward()
    assert prediction.grad[0].abs().sum() == 0
    assert prediction.grad[1].abs().sum() == 0
    assert prediction.grad[2].abs().sum() > 0
    assert localisation_loss(prediction, target, torch.zeros(3)).item() == 0.0
