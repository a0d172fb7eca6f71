from __future__ import annotations

from tr_grasp.configs import ImitationCfg, OptimiserCfg
from tr_grasp.trainers.schedules import imitation_weight, learning_rate, warmup


def test_the_learning_rate_is_constant_then_falls_linearly():
    cfg = OptimiserCfg(learning_rate=1.0, decay_start=0.6, final_fraction=0.1)
    rates = [round(learning_rate(cfg, progress), 6) for progress in (0.0, 0.6, 0.8, 1.0, 2.0)]
    assert rates == [1.0, 1.0, 0.55, 0.1, 0.1]


def test_the_thesis_rate_falls_from_the_beginning_to_zero():
    cfg = OptimiserCfg(learning_rate=1.0, decay_start=0.0, final_fraction=0.0)
    assert [learning_rate(cfg, progress) for progress in (0.0, 0.25, 1.0)] == [1.0, 0.75, 0.0]


def test_a_decay_that_starts_at_the_end_never_comes():
    assert learning_rate(OptimiserCfg(learning_rate=1.0, decay_start=1.0), 1.5) == 1.0


def test_the_imitation_weight_changes_linearly_and_stays():
    cfg = ImitationCfg(weight_initial=2.0, weight_final=0.5, decay_env_steps=100)
    assert [imitation_weight(cfg, steps) for steps in (0, 50, 100, 500)] == [2.0, 1.25, 0.5, 0.5]
    assert imitation_weight(ImitationCfg(weight_final=0.5, decay_env_steps=0), 0) == 0.5


def test_the_warm_up_may_be_left_out():
    assert [warmup(updates, 4) for updates in (0, 1, 4, 9)] == [0.0, 0.25, 1.0, 1.0]
    assert warmup(0, 0) == 1.0
