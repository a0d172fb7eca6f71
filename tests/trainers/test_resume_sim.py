"""The promise of an exact resume, with the simulator in the loop."""

from __future__ import annotations

import pytest
import torch

from tr_grasp.configs.io import load_train_cfg
from tr_grasp.trainers import RunFolder, Trainer
from tr_grasp.trainers.checkpoint import load_checkpoint

pytestmark = pytest.mark.sim


class Crash(Exception):
    pass


def run(folder, evaluate, *, resume=False):
    from tr_grasp.envs import env_spec, make_env

    cfg = load_train_cfg("smoke")
    trainer = Trainer(cfg, RunFolder(folder), make_env=make_env, env_spec=env_spec(cfg.env), evaluate=evaluate)
    trainer.run(resume=resume)
    return load_checkpoint(folder / "checkpoint.pt")["session"]


def test_an_interrupted_and_resumed_run_equals_an_uninterrupted_one(tmp_path):
    scores = iter([0.0])

    def crash_the_second_time(policy):
        try:
            return {"success": next(scores)}
        except StopIteration:
            raise Crash from None

    whole = run(tmp_path / "whole", lambda policy: {"success": 0.0})
    with pytest.raises(Crash):
        run(tmp_path / "parts", crash_the_second_time)
    assert load_checkpoint(tmp_path / "parts" / "checkpoint.pt")["session"]["counters"]["env_steps"] == 40
    torch.rand(17)  # a new process has another state
    parts = run(tmp_path / "parts", lambda policy: {"success": 0.0}, resume=True)
    for table in ("observations", "transitions"):
        for name, rows in whole["experience"][table].items():
            assert torch.equal(rows, parts["experience"][table][name]), name
    for name, value in whole["learner"]["loss"].items():
        assert torch.equal(value, parts["learner"]["loss"][name]), name
    assert torch.equal(whole["random"]["torch"], parts["random"]["torch"])
