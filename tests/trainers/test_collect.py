from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from tensordict import TensorDict
from torchrl.envs.utils import ExplorationType, exploration_type

from tests.toy_env import env_spec, make_env, train_cfg
from tr_grasp.errors import ConfigError, TrGraspError
from tr_grasp.keys import ACTION, EXPERT_ACTION
from tr_grasp.modules import build_agent
from tr_grasp.octree import OctreeFrame
from tr_grasp.trainers.acting import STEP_COUNT, ExploringPolicy, RandomActions, ScriptedExpert
from tr_grasp.trainers.collect import Collection, CollectPlan, worker_seed

ROOT = Path(__file__).parents[2]


def plan(**changes) -> CollectPlan:
    cfg = train_cfg()
    env = replace(cfg.env, observation=replace(cfg.env.observation, expert_labels=True))
    return replace(CollectPlan(make_env, env, seed=0, segment=1, steps_per_batch=20), **changes)


def take(collection: Collection, n: int) -> list[TensorDict]:
    return [chunk.clone() for chunk, _ in zip(collection, range(n), strict=False)]


def refuse_to_start(cfg, seed):
    raise ConfigError("no such robot")


def die_on_start(cfg, seed):
    class Dying(type(make_env(cfg))):
        def _step(self, tensordict):
            os.kill(os.getpid(), signal.SIGKILL)

    return Dying(cfg, seed)


def test_chunks_are_consecutive_steps():
    with Collection(plan(), RandomActions(5)) as collection:
        first, second = take(collection, 2)
    steps = torch.cat([first, second])
    assert isinstance(steps["octree"], OctreeFrame)
    goes_on = ~steps["next", "done"][:-1, 0]
    assert torch.equal(steps["next", "proprio"][:-1][goes_on], steps["proprio"][1:][goes_on])
    assert goes_on.any()


def first_goals(**changes) -> torch.Tensor:
    torch.manual_seed(worker_seed(0, 1, 0))
    with Collection(plan(**changes), RandomActions(5)) as collection:
        return take(collection, 1)[0]["octree"].codes[:, 0]


def test_the_seed_the_segment_and_the_worker_decide_the_episodes():
    assert torch.equal(first_goals(), first_goals())
    assert not torch.equal(first_goals(), first_goals(segment=2))
    assert not torch.equal(first_goals(), first_goals(seed=1))
    assert len({worker_seed(s, e, w) for s in range(4) for e in range(4) for w in range(4)}) == 64


def test_a_worker_collects_what_this_process_would():
    assert torch.equal(first_goals(mode="process"), first_goals())


def test_episodes_can_be_cut():
    with Collection(plan(episode_steps=3), RandomActions(5)) as collection:
        (chunk,) = take(collection, 1)
    ends = chunk["next", "done"].flatten().nonzero().flatten()
    assert ends[:3].tolist() == [2, 5, 8]
    assert chunk["next", "truncated"][2]
    assert not chunk["next", "terminated"][2]


def test_workers_act_with_the_weights_that_were_pushed():
    cfg = train_cfg()
    agent = build_agent(cfg, env_spec(cfg.env))
    policy = ExploringPolicy(agent.policy.requires_grad_(False), 0.0)
    with Collection(plan(mode="process", deterministic=True), policy) as collection:
        chunks = iter(collection)
        next(chunks)
        agent.actor.module[0].module.net[-1].weight.zero_()
        agent.actor.module[0].module.net[-1].bias.fill_(0.5)
        collection.push_weights()
        # At most one chunk is under way with the old weights and one half-way through.
        actions = [next(chunks)[ACTION].clone() for _ in range(4)][-1]
    torch.testing.assert_close(actions, torch.tensor(0.5).tanh().expand_as(actions))


def test_running_statistics_and_spectral_vectors_are_pushed_with_the_weights():
    cfg = train_cfg()
    network = {"encoder": "residual_ocnn", "norm": "batch", "heads": "advanced", "spectral_norm": "all"}
    cfg = replace(
        cfg,
        network=replace(cfg.network, residual_width=8, **network),
        algorithm=replace(cfg.algorithm, name="td3"),
    )
    torch.manual_seed(0)
    policy = build_agent(cfg, env_spec(cfg.env)).policy.requires_grad_(False).eval()
    with Collection(plan(mode="process", deterministic=True), ExploringPolicy(policy, 0.0)) as collection:
        chunks = iter(collection)
        next(chunks)
        for name, buffer in policy.named_buffers():
            if "running" in name:
                buffer += 0.5
            elif name.endswith(".u"):
                buffer.mul_(0.7)
        collection.push_weights()
        chunk = [next(chunks).clone() for _ in range(4)][-1]
    torch.testing.assert_close(chunk[ACTION], policy(chunk.clone())[ACTION])


def test_several_workers_all_deliver_and_none_survives():
    with Collection(plan(mode="process", workers_n=2), RandomActions(5)) as collection:
        workers = list(collection._collector.procs)
        seen = {int(chunk["collector", "traj_ids"][0]) for chunk in take(collection, 8)}
    assert len(seen) > 2
    assert not any(worker.is_alive() for worker in workers)
    assert torch.get_num_threads() == 1


def test_a_mistake_in_the_settings_is_told_in_the_workers_words_alone():
    with pytest.raises(ConfigError, match=r"^no such robot$"):
        Collection(plan(make_env=refuse_to_start, mode="process"), RandomActions(5))


def test_a_worker_that_is_killed_is_reported():
    with (
        Collection(plan(make_env=die_on_start, mode="process"), RandomActions(5)) as collection,
        pytest.raises(TrGraspError, match="exit code -9"),
    ):
        take(collection, 3)


def test_ctrl_c_does_not_reach_the_workers():
    """A terminal sends it to the whole process group."""
    script = textwrap.dedent("""
        import os, signal, sys
        from tests.trainers.test_collect import plan, take, RandomActions, Collection
        if __name__ == "__main__":
            # What a shell starts in the background inherits that Ctrl-C is ignored.
            signal.signal(signal.SIGINT, signal.default_int_handler)
            with Collection(plan(mode="process"), RandomActions(5)) as collection:
                take(collection, 1)
                try:
                    os.killpg(os.getpgid(0), signal.SIGINT)
                    signal.pause()
                except KeyboardInterrupt:
                    print("main interrupted")
                print(len(take(collection, 3)), "chunks after it")
    """)
    result = subprocess.run(
        [sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, timeout=400, start_new_session=True
    )
    assert result.stdout.split("\n")[:2] == ["main interrupted", "3 chunks after it"], result.stderr


def test_noise_moves_the_policys_action_and_stays_in_range():
    class Constant(RandomActions):
        def forward(self, tensordict):
            return tensordict.set(ACTION, torch.full((5,), 0.9))

    noisy = ExploringPolicy(Constant(5), 0.5)
    actions = torch.stack([noisy(TensorDict())[ACTION] for _ in range(200)])
    assert actions.max() == 1.0
    assert 0.2 < actions.std() < 0.5
    assert torch.equal(ExploringPolicy(Constant(5), 0.0)(TensorDict())[ACTION], torch.full((5,), 0.9))


def test_a_share_of_the_episodes_acts_without_exploring():
    class Asked(RandomActions):
        def forward(self, tensordict):
            sampled = exploration_type() != ExplorationType.DETERMINISTIC
            return tensordict.set(ACTION, torch.full((5,), float(sampled)))

    policy = ExploringPolicy(Asked(5), 0.0, deterministic_share=0.3)
    episodes = []
    for _ in range(400):
        steps = [float(policy(TensorDict({STEP_COUNT: torch.tensor([t])}))[ACTION][0]) for t in range(3)]
        assert len(set(steps)) == 1  # the choice is made once an episode
        episodes.append(steps[0])
    assert 0.6 < sum(episodes) / 400 < 0.8


def test_the_judged_policy_plays_the_episodes_without_exploration_and_the_latest_the_others():
    class Constant(RandomActions):
        def __init__(self, value: float) -> None:
            super().__init__(5)
            self.value = value

        def forward(self, tensordict):
            return tensordict.set(ACTION, torch.full((5,), self.value))

    first = TensorDict({STEP_COUNT: torch.tensor([0])})
    for share, expected in ((1.0, 0.25), (0.0, 0.5)):
        acting = ExploringPolicy(Constant(0.5), 0.0, deterministic_share=share, judged=Constant(0.25))
        assert acting(first)[ACTION].tolist() == [expected] * 5


def test_the_expert_keeps_its_noise_for_an_episode_and_its_label_clean():
    expert = ScriptedExpert((0.0, 1.0), 0.0)
    label = torch.tensor([0.1, 0.1, 0.1, 0.1, -1.0])
    noisy_episodes = 0
    for _ in range(20):
        moved = []
        for step in range(6):
            state = TensorDict({EXPERT_ACTION: label, "step_count": torch.tensor([step])})
            action = expert(state)[ACTION]
            moved.append(not torch.equal(action, label))
            assert torch.equal(state[EXPERT_ACTION], label)
            assert action[-1] == -1.0
        assert len(set(moved)) == 1
        noisy_episodes += moved[0]
    assert 3 < noisy_episodes < 17


def test_the_expert_wanders_with_an_open_gripper_before_it_goes_to_its_grasp():
    expert = ScriptedExpert((), 0.0, wander_steps=3)
    label = torch.tensor([0.1, 0.1, 0.1, 0.1, -1.0])
    lengths = []
    for _ in range(60):
        actions = torch.stack(
            [expert(TensorDict({EXPERT_ACTION: label, "step_count": torch.tensor([k])}))[ACTION] for k in range(5)]
        )
        wanders = (actions != label).any(1)
        lengths.append(int(wanders.sum()))
        assert wanders[: lengths[-1]].all()
        assert (actions[wanders, -1] == 1.0).all()
        assert (actions[wanders, :-1].abs() <= 1.0).all()
    assert set(lengths) == {0, 1, 2, 3}


def test_each_environment_of_a_batch_wanders_for_its_own_time():
    expert = ScriptedExpert((), 0.0, wander_steps=4)
    label = torch.full((200, 5), -1.0)
    wandered = torch.zeros(200)
    for k in range(6):
        state = TensorDict({EXPERT_ACTION: label, "step_count": torch.full((200, 1), k)}, [200])
        wandered += (expert(state)[ACTION] != label).any(1)
    assert {0, 1, 2, 3, 4} == set(wandered.int().tolist())


def test_the_experts_gripper_is_flipped_now_and_then():
    expert = ScriptedExpert((), 0.25)
    state = TensorDict({EXPERT_ACTION: torch.ones(5), "step_count": torch.tensor([1])})
    flips = sum(float(expert(state.clone())[ACTION][-1]) < 0 for _ in range(400))
    assert 60 < flips < 140
