"""Several environments in a process, several processes, Ray."""

from __future__ import annotations

import multiprocessing
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
import torch
from tensordict import TensorDict
from torchrl.envs import SerialEnv
from torchrl.envs.utils import ExplorationType, exploration_type

from tests.toy_env import env_spec, make_env, train_cfg
from tests.trainers.test_collect import plan, take
from tests.trainers.test_trainer import Crash, assert_equal, crash_at, trainer
from tr_grasp.configs import EnvCfg
from tr_grasp.errors import ConfigError
from tr_grasp.keys import ACTION, EXPERT_ACTION
from tr_grasp.modules import build_agent
from tr_grasp.octree import OctreeFrame
from tr_grasp.trainers.acting import STEP_COUNT, ExploringPolicy, RandomActions, ScriptedExpert
from tr_grasp.trainers.checkpoint import load_checkpoint
from tr_grasp.trainers.collect import Collection, environments_of, worker_seed
from tr_grasp.trainers.demonstration_file import Recording
from tr_grasp.trainers.ray_collector import start_ray_collector


def test_a_chunk_of_several_environments_has_consecutive_steps_of_each():
    with Collection(plan(envs_per_worker_n=2), RandomActions(5)) as collection:
        first, second = take(collection, 2)
    assert first.batch_size == (2, 10)
    assert isinstance(first["octree"], OctreeFrame)
    for before, after in zip(environments_of(first), environments_of(second), strict=True):
        steps = torch.cat([before, after])
        goes_on = ~steps["next", "done"][:-1, 0]
        assert torch.equal(steps["next", "proprio"][:-1][goes_on], steps["proprio"][1:][goes_on])
        assert goes_on.any()


def test_every_environment_has_a_seed_of_its_own_however_they_are_shared_out():
    def goals(**changes):
        with Collection(plan(**changes), RandomActions(5)) as collection:
            (chunk,) = take(collection, 1)
        return [part["octree"].codes[0, 0] for part in environments_of(chunk)]

    seen = goals(envs_per_worker_n=2, steps_per_batch=4)
    expected = []
    for env in range(2):
        toy = make_env(plan().env, worker_seed(0, 1, env))
        expected.append(toy.reset()["octree"].codes[0])
    assert torch.equal(seen[0], expected[0])
    assert torch.equal(seen[1], expected[1])
    assert not torch.equal(expected[0], expected[1])


def test_each_environment_of_a_batch_explores_or_not_for_a_whole_episode():
    class Asked(RandomActions):
        def forward(self, tensordict):
            sampled = exploration_type() != ExplorationType.DETERMINISTIC
            return tensordict.set(ACTION, torch.full((*tensordict.batch_size, 5), float(sampled)))

    policy = ExploringPolicy(Asked(5), 0.0, deterministic_share=0.3)
    steps = torch.zeros(200, 1, dtype=torch.int64)
    first = policy(TensorDict({STEP_COUNT: steps}, [200]))[ACTION]
    assert 0.6 < first[:, 0].mean() < 0.8
    later = policy(TensorDict({STEP_COUNT: steps + 1}, [200]))[ACTION]
    assert torch.equal(first, later)
    steps[100:] += 2
    redrawn = policy(TensorDict({STEP_COUNT: steps}, [200]))[ACTION]
    assert torch.equal(redrawn[100:], first[100:])
    assert not torch.equal(redrawn[:100], first[:100])


def test_the_expert_has_noise_of_its_own_in_each_environment():
    expert = ScriptedExpert((0.0, 1.0), 0.0)
    state = TensorDict({EXPERT_ACTION: torch.full((64, 5), 0.1), STEP_COUNT: torch.zeros(64, 1)}, [64])
    moved = (expert(state)[ACTION][:, :4] != 0.1).any(1)
    assert 16 < moved.sum() < 48


def test_a_run_with_several_environments_resumes_exactly(tmp_path):
    cfg = train_cfg(envs_per_worker_n=2, deterministic_share=0.5, collector="inline")
    trainer(tmp_path / "whole", cfg, evaluate=lambda policy: {"success": 0.5}).run()
    with pytest.raises(Crash):
        trainer(tmp_path / "parts", cfg, evaluate=crash_at(120, cfg)).run()
    torch.rand(17)
    result = trainer(tmp_path / "parts", cfg, evaluate=lambda policy: {"success": 0.5}).run(resume=True)
    assert result.env_steps == cfg.trainer.env_steps
    whole, parts = (load_checkpoint(tmp_path / name / "checkpoint.pt") for name in ("whole", "parts"))
    assert_equal(whole["session"], parts["session"])


def test_steps_must_share_out_evenly():
    with pytest.raises(ConfigError, match=r"multiple of trainer\.envs_per_worker_n, got 20 and 3"):
        train_cfg(envs_per_worker_n=3)


def test_missing_ray_is_told_with_its_cure(monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(ConfigError, match=r"pip install 'tr-grasp\[ray\]'"):
        start_ray_collector([], RandomActions(5))


@pytest.mark.slow
def test_two_ray_workers_collect_with_the_weights_that_were_pushed(monkeypatch):
    pytest.importorskip("ray")
    # A busy machine takes longer than Ray's half minute to start it.
    monkeypatch.setenv("RAY_raylet_start_wait_time_s", "240")
    cfg = train_cfg()
    agent = build_agent(cfg, env_spec(cfg.env))
    policy = ExploringPolicy(agent.policy.requires_grad_(False), 0.0)
    how = plan(make_env=make_env, mode="ray", workers_n=2, deterministic=True)
    with Collection(how, policy) as collection:
        chunks = iter(collection)
        firsts = [next(chunks) for _ in range(4)]
        agent.actor.module[0].module.net[-1].weight.zero_()
        agent.actor.module[0].module.net[-1].bias.fill_(0.5)
        collection.push_weights()
        last = [next(chunks) for _ in range(6)][-1]
    assert all(chunk.batch_size == (20,) for chunk in firsts)
    assert len({float(chunk["octree"].codes[0, 0].sum()) for chunk in firsts}) > 1
    torch.testing.assert_close(last[ACTION], torch.tensor(0.5).tanh().expand_as(last[ACTION]))


def sim_cfg() -> EnvCfg:
    cfg = EnvCfg()
    return replace(cfg, episode_steps=6, objects=replace(cfg.objects, count_range=(2, 2)))


@pytest.mark.sim
def test_resetting_one_environment_leaves_its_neighbour_bit_equal():
    from tr_grasp.envs import make_env as make_sim

    def second_env(reset_first_at: int | None) -> list[TensorDict]:
        envs = SerialEnv(2, [lambda seed=seed: make_sim(sim_cfg(), seed) for seed in (3, 4)])
        generator = torch.Generator().manual_seed(0)
        td, seen = envs.reset(), []
        for step in range(4):
            if step == reset_first_at:
                td = envs.reset(td.set("_reset", torch.tensor([[True], [False]]))).exclude("_reset")
            td.set(ACTION, torch.rand(2, 5, generator=generator) * 2 - 1)
            td = envs.step(td)
            seen.append(td["next"][1].clone())
            td = envs.step_mdp(td)
        envs.close()
        return seen

    for alone, beside in zip(second_env(None), second_env(2), strict=True):
        for key in alone.keys(True, True):
            assert torch.equal(alone[key], beside[key]), key


def record_in_the_simulator(seeds: list[int]) -> dict[int, dict[str, np.ndarray]]:
    os.environ["OMP_NUM_THREADS"] = "1"
    from tr_grasp.envs import make_env as make_sim
    from tr_grasp.trainers.record import Recorder

    env = sim_cfg()
    env = replace(env, observation=replace(env.observation, expert_labels=True))
    recorder = Recorder(Recording(env, noise_scale=(0.1, 0.3), episode_steps=6), make_sim, None)
    recorded = {seed: dict(recorder.record(seed).arrays) for seed in seeds}
    recorder.close()
    return recorded


@pytest.mark.sim
def test_equal_seeds_are_bit_equal_across_processes():
    """The other process plays another episode first."""
    here = record_in_the_simulator([5])
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        there = pool.submit(record_in_the_simulator, [6, 5]).result()
    for name, array in here[5].items():
        np.testing.assert_array_equal(array, there[5][name], err_msg=name)
    assert any(not np.array_equal(there[6][name][:3], there[5][name][:3]) for name in there[5])
