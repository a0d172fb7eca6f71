from __future__ import annotations

import json
import os
import random
import signal
from dataclasses import replace

import pytest
import torch

from tests.toy_env import env_spec, make_env, train_cfg, with_pictures
from tr_grasp.configs import TrainCfg
from tr_grasp.errors import CheckpointError, TrainingDivergedError
from tr_grasp.modules import load_policy
from tr_grasp.trainers import RunFolder, Trainer
from tr_grasp.trainers.checkpoint import load_checkpoint


class Crash(Exception):
    """Stands for whatever ends a process."""


def trainer(folder, cfg: TrainCfg | None = None, **kwargs) -> Trainer:
    cfg = cfg or train_cfg()
    return Trainer(cfg, RunFolder(folder), make_env=make_env, env_spec=env_spec(cfg.env), **kwargs)


def assert_equal(a, b, path=""):
    """Same structure, same bits."""
    assert type(a) is type(b), path
    if isinstance(a, dict):
        assert a.keys() == b.keys(), path
        for key in a:
            if not (key == "wall_s" or str(key).startswith("rate/")):
                assert_equal(a[key], b[key], f"{path}/{key}")
    elif isinstance(a, list):
        assert len(a) == len(b), path
        for index, pair in enumerate(zip(a, b, strict=True)):
            assert_equal(*pair, f"{path}/{index}")
    elif isinstance(a, torch.Tensor):
        assert torch.equal(a, b), path
    else:
        assert a == b, path


def crash_at(steps: int, cfg: TrainCfg):
    """An evaluation that crashes at the given environment steps, and otherwise scores the same each time."""
    calls = iter(range(1, 100))

    def evaluate(policy):
        if next(calls) * cfg.trainer.evaluate_every == steps:
            raise Crash
        return {"success": 0.5}

    return evaluate


@pytest.mark.parametrize("crash_steps", [60, 120])
def test_an_interrupted_and_resumed_run_equals_an_uninterrupted_one(tmp_path, crash_steps):
    cfg = train_cfg()
    whole = trainer(tmp_path / "whole", cfg, evaluate=lambda policy: {"success": 0.5}).run()
    with pytest.raises(Crash):
        trainer(tmp_path / "parts", cfg, evaluate=crash_at(crash_steps, cfg)).run()
    reached = load_checkpoint(tmp_path / "parts" / "checkpoint.pt")["session"]["counters"]["env_steps"]
    assert reached == {60: 40, 120: 80}[crash_steps]
    torch.rand(17)  # a new process has another state
    resumed = trainer(tmp_path / "parts", cfg, evaluate=lambda policy: {"success": 0.5}).run(resume=True)
    assert (whole.env_steps, whole.updates) == (resumed.env_steps, resumed.updates) == (120, 30)
    states = [load_checkpoint(tmp_path / name / "checkpoint.pt") for name in ("whole", "parts")]
    assert_equal(*states)
    csv = [(tmp_path / name / "progress.csv").read_text().splitlines() for name in ("whole", "parts")]
    assert len(csv[0]) == len(csv[1])


def test_what_other_threads_draw_from_pythons_generator_is_no_part_of_a_run(tmp_path):
    """A web server's pings draw from it now and then; the run itself must not, or it could not be repeated."""

    def drawn_from_meanwhile(policy):
        random.random()
        return {"success": 0.5}

    runs = {"quiet": lambda policy: {"success": 0.5}, "disturbed": drawn_from_meanwhile}
    for name, evaluate in runs.items():
        trainer(tmp_path / name, evaluate=evaluate).run()
    assert_equal(*(load_checkpoint(tmp_path / name / "checkpoint.pt") for name in runs))


@pytest.mark.parametrize("name", ["sac", "td3", "ddpg"])
def test_every_algorithm_and_every_buffer_resumes_exactly(tmp_path, name):
    cfg = train_cfg(env_steps=80, evaluate_every=60)
    network = {"encoder": "residual_ocnn", "norm": "batch", "heads": "advanced", "spectral_norm": "all"}
    cfg = replace(
        cfg,
        network=replace(cfg.network, residual_width=8, **network),
        algorithm=replace(cfg.algorithm, name=name),
        replay=replace(cfg.replay, batch_size=4),
    )
    whole = trainer(tmp_path / "whole", cfg, evaluate=lambda policy: {"success": 0.5})
    whole.run()
    with pytest.raises(Crash):
        trainer(tmp_path / "parts", cfg, evaluate=crash_at(60, cfg)).run()
    torch.rand(17)
    trainer(tmp_path / "parts", cfg, evaluate=lambda policy: {"success": 0.5}).run(resume=True)
    states = [load_checkpoint(tmp_path / name / "checkpoint.pt") for name in ("whole", "parts")]
    assert_equal(*states)
    policies = [load_policy(tmp_path / name / "last")[0] for name in ("whole", "parts")]
    assert_equal(*(dict(policy.state_dict()) for policy in policies))
    trained = whole._session.learner.average.policy.state_dict()
    assert all(torch.equal(value, trained[key]) for key, value in policies[0].state_dict().items())
    assert any("running_mean" in key and value.any() for key, value in trained.items())


def test_a_run_on_pictures_learns_and_resumes_exactly(tmp_path):
    cfg = with_pictures(train_cfg(env_steps=80, evaluate_every=60))
    whole = trainer(tmp_path / "whole", cfg, evaluate=lambda policy: {"success": 0.5})
    before = {key: value.clone() for key, value in whole._session.agent.encoder.state_dict().items()}
    whole.run()
    after = whole._session.agent.encoder.state_dict()
    assert not any(torch.equal(value, after[key]) for key, value in before.items() if value.is_floating_point())
    with pytest.raises(Crash):
        trainer(tmp_path / "parts", cfg, evaluate=crash_at(60, cfg)).run()
    torch.rand(17)
    trainer(tmp_path / "parts", cfg, evaluate=lambda policy: {"success": 0.5}).run(resume=True)
    assert_equal(*(load_checkpoint(tmp_path / name / "checkpoint.pt") for name in ("whole", "parts")))
    policy, loaded = load_policy(tmp_path / "whole" / "last")
    assert loaded.env.observation.image
    assert policy.in_keys == ["colour_image", "depth_image", "proprio"]


def test_a_run_leaves_its_settings_record_curve_and_policies(tmp_path):
    lines: list[str] = []
    result = trainer(tmp_path / "run", report=lines.append, command="tr-grasp train toy").run()
    folder = tmp_path / "run"
    assert not result.interrupted
    record = json.loads((folder / "training.json").read_text())
    assert record["command"] == "tr-grasp train toy"
    assert (record["env_steps"], record["updates"], record["demonstrations"]) == (120, 30, 40)
    assert [row["env_steps"] for row in record["curve"]] == [40, 60, 80, 120]
    assert {"torch", "torchrl", "python"} <= set(record["versions"])
    header = (folder / "progress.csv").read_text().splitlines()[0].split(",")
    assert {"env_steps", "wall_s", "train/success", "evaluation/success", "learner/loss_qvalue"} <= set(header)
    assert list((folder / "tensorboard").glob("events*"))
    for name in ("best", "last"):
        assert load_policy(folder / name)[1] == train_cfg()
    assert any("120/120 steps" in line for line in lines)


def test_the_best_policy_is_kept_while_the_last_one_goes_on(tmp_path):
    scores = iter([0.9, 0.2])
    result = trainer(tmp_path / "run", evaluate=lambda policy: {"success": next(scores)}).run()
    assert result.best_success == 0.9
    best, last = (json.loads((tmp_path / "run" / name / "training.json").read_text()) for name in ("best", "last"))
    assert best["evaluation"]["success"] == 0.9
    assert (best["env_steps"], last["env_steps"]) == (60, 120)
    policies = [load_policy(tmp_path / "run" / name)[0] for name in ("best", "last")]
    pairs = zip(*(policy.parameters() for policy in policies), strict=True)
    assert any(not torch.equal(a, b) for a, b in pairs)


def test_the_evaluated_policy_has_the_learners_averaged_weights(tmp_path):
    seen = []

    def evaluate(policy):
        seen.append([p.clone() for p in policy.parameters()])
        return {"success": 0.0}

    run = trainer(tmp_path / "run", evaluate=evaluate)
    run.run()
    average = run._session.learner.average.policy.parameters()
    assert all(torch.equal(a, b) for a, b in zip(seen[-1], average, strict=True))


def test_ctrl_c_ends_the_run_with_a_checkpoint_that_can_be_resumed(tmp_path):
    def interrupt(policy):
        os.kill(os.getpid(), signal.SIGINT)
        return {"success": 0.0}

    result = trainer(tmp_path / "run", evaluate=interrupt).run()
    assert result.interrupted
    assert result.env_steps == 60
    assert load_checkpoint(tmp_path / "run" / "checkpoint.pt")["session"]["counters"]["env_steps"] == 60
    resumed = trainer(tmp_path / "run", evaluate=lambda policy: {"success": 0.0}).run(resume=True)
    assert (resumed.env_steps, resumed.interrupted) == (120, False)


def test_ctrl_c_while_demonstrations_are_recorded_keeps_them(tmp_path):
    def interrupt(line):
        if "recording" in line:
            os.kill(os.getpid(), signal.SIGINT)

    assert trainer(tmp_path / "run", report=interrupt).run().env_steps == 0
    assert trainer(tmp_path / "run").run(resume=True).env_steps == 120


def test_a_diverging_run_stops_and_its_last_checkpoint_stays(tmp_path, monkeypatch):
    run = trainer(tmp_path / "run", evaluate=lambda policy: {"success": 0.0})
    draw = run._session.sampler.mixed

    def poisoned():
        batch = draw()
        if run._session.counters.env_steps > 80:
            batch["next", "reward"][0] = float("inf")
        return batch

    monkeypatch.setattr(run._session.sampler, "mixed", poisoned)
    with pytest.raises(TrainingDivergedError, match="diverged_batch"):
        run.run()
    assert load_checkpoint(tmp_path / "run" / "checkpoint.pt")["session"]["counters"]["env_steps"] == 80
    assert (tmp_path / "run" / "diverged_batch.pt").is_file()


def test_collecting_in_processes_reaches_the_end_and_resumes(tmp_path):
    cfg = train_cfg(collector="process", evaluate_every=0)
    assert trainer(tmp_path / "run", cfg).run().updates == 30
    longer = replace(cfg, trainer=replace(cfg.trainer, env_steps=160))
    result = trainer(tmp_path / "run", longer).run(resume=True)
    assert (result.env_steps, result.updates) == (160, 40)


def test_the_thesis_way_needs_no_demonstrations(tmp_path):
    cfg = train_cfg(random_steps=40)
    cfg = replace(
        cfg,
        demonstrations=replace(cfg.demonstrations, transitions_n=0),
        imitation=replace(cfg.imitation, weight_initial=0.0, weight_final=0.0),
        algorithm=replace(cfg.algorithm, encoder_grad="actor", action_noise=0.025, alpha_min=0.0),
    )
    assert trainer(tmp_path / "run", cfg).run().updates == 30


def test_a_finished_episode_can_pay_for_updates_whatever_its_length(tmp_path):
    cfg = train_cfg(updates_per_step=0.0, updates_per_episode=3, learning_starts=0)
    run = trainer(tmp_path / "run", cfg)
    result = run.run()
    done = run._session.experience.get(torch.arange(result.env_steps))["next", "done"]
    assert result.updates == 3 * int(done.sum()) > 0


def test_imitating_every_visited_state_needs_no_reinforcement(tmp_path):
    cfg = train_cfg()
    cfg = replace(cfg, imitation=replace(cfg.imitation, states="all", reinforcement=False))
    run = trainer(tmp_path / "run", cfg)
    run.run()
    assert run._session.experience.sample(20)["expert_action"].any(dim=1).all()


def test_there_must_be_something_to_resume(tmp_path):
    with pytest.raises(CheckpointError, match="nothing to resume"):
        trainer(tmp_path / "run").run(resume=True)


def test_a_checkpoint_of_other_networks_is_refused(tmp_path):
    cfg = train_cfg(env_steps=20, evaluate_every=0)
    trainer(tmp_path / "run", cfg).run()
    wider = replace(cfg, network=replace(cfg.network, actor_hidden_n=(48,)))
    with pytest.raises(CheckpointError, match="does not fit the settings"):
        trainer(tmp_path / "run", wider).run(resume=True)
