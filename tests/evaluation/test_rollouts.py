from __future__ import annotations

import multiprocessing
import threading
from dataclasses import replace
from multiprocessing.connection import Connection

import pytest
import torch

from tests.evaluation.fake_task import make_broken_env, make_fake_env
from tr_grasp.configs import EnvCfg, ObservationCfg, TrainCfg
from tr_grasp.errors import ConfigError, MeshError
from tr_grasp.evaluation import players
from tr_grasp.evaluation.players import load_player
from tr_grasp.evaluation.records import EpisodeRecord, in_order
from tr_grasp.evaluation.rollouts import play_episode, run_episode, run_suites
from tr_grasp.evaluation.suites import Suite, named_suites
from tr_grasp.evaluation.workers import WorkerDiedError, _collect, _serve

CFG = EnvCfg(episode_steps=15)


def suites_for(player: str, episodes: int = 6, which: str = "all") -> list[Suite]:
    base = replace(load_player(player).env, episode_steps=15)
    return named_suites(which, base, objects="test", episodes=episodes, first_seed=50)


def played(player: str, **options: object) -> list[EpisodeRecord]:
    return list(run_suites(suites_for(player, **options), player, make_env=make_fake_env))


def test_who_obeys_the_expert_wins_unless_the_object_slips() -> None:
    records = played("scripted", episodes=30, which="single")
    assert {record.outcome for record in records} == {"lifted", "grasped, then slipped or dropped"}
    for record in records:
        assert record.success == record.lifted == (record.outcome == "lifted")
        assert record.reached
        assert 3 <= record.steps <= (12 if record.success else 15)
        assert record.reward == pytest.approx(400 * record.success - 0.005 * record.steps)
        assert record.objects_n == len(record.objects) == 1
        assert record.objects[0].startswith(record.families[0])


def test_who_does_nothing_never_wins() -> None:
    records = played("zero", which="pile")
    assert [(r.success, r.steps, r.outcome) for r in records] == [(False, 15, "never reached an object")] * 6
    assert [(r.suite, r.episode, r.seed, r.objects_n) for r in records] == [("pile", i, 50 + i, 4) for i in range(6)]


@pytest.mark.parametrize("player", ["scripted", "random"])
def test_an_episode_depends_on_its_seed_alone(player: str) -> None:
    suite = suites_for(player, which="single")[0]
    policy, env = load_player(player).policy, make_fake_env(suite.env)
    first = [run_episode(env, policy, suite, i) for i in range(4)]
    torch.manual_seed(9)
    assert [run_episode(env, policy, suite, i) for i in (3, 1)] == [first[3], first[1]]
    assert run_episode(make_fake_env(suite.env), policy, suite, 2) == first[2]


def test_random_actions_differ_between_episodes() -> None:
    actions = []
    env, policy = make_fake_env(CFG), load_player("random").policy
    for seed in (1, 2):
        play_episode(env, policy, seed, lambda _env, _step, action, _state: actions.append(action))
    first, second = actions[1], actions[17]
    assert not torch.equal(first, second)
    assert torch.cat([first, second]).abs().max() <= 1


def test_playing_leaves_torchs_random_state_and_threads_alone() -> None:
    torch.manual_seed(3)
    threads = torch.get_num_threads()
    expected = torch.rand(1)
    torch.manual_seed(3)
    played("random", episodes=1, which="single")
    assert torch.rand(1) == expected
    assert torch.get_num_threads() == threads


def test_a_watcher_sees_the_start_and_every_step() -> None:
    suite = suites_for("scripted", which="single")[0]
    seen = []
    env = make_fake_env(suite.env)
    record = run_episode(
        env, load_player("scripted").policy, suite, 0, lambda _, step, action, state: seen.append((step, action, state))
    )
    assert [step for step, _, _ in seen] == list(range(record.steps + 1))
    assert seen[0][1] is None
    assert seen[1][1].shape == (5,)
    assert bool(seen[-1][2]["success"]) == record.success


def test_only_the_expert_is_shown_the_experts_action() -> None:
    assert load_player("scripted").env.observation.expert_labels
    assert not load_player("random").env.observation.expert_labels


def test_a_policy_that_learned_from_the_expert_is_judged_without_it(monkeypatch: pytest.MonkeyPatch) -> None:
    learned = EnvCfg(control_hz=2.5, observation=ObservationCfg(stack_n=1, expert_labels=True))
    training = TrainCfg(env=learned)
    monkeypatch.setattr(players, "shipped_policies", lambda: ["panda"])
    monkeypatch.setattr(players, "load_policy", lambda name: (torch.nn.Identity(), training))
    player = load_player("panda")
    assert player.env == replace(learned, observation=ObservationCfg(stack_n=1))
    assert player.training == training


def test_an_unknown_player_is_one_sentence() -> None:
    with pytest.raises(ConfigError, match="unknown policy 'scriptd'; did you mean 'scripted'"):
        load_player("scriptd")


def test_two_workers_find_what_one_finds() -> None:
    suites = suites_for("random", episodes=3)
    alone = played("random", episodes=3)
    together = run_suites(suites, "random", workers=2, make_env=make_fake_env)
    assert in_order(together) == in_order(alone)


@pytest.mark.slow
def test_closing_early_ends_the_workers() -> None:
    episodes = run_suites(suites_for("random", episodes=50), "random", workers=2, make_env=make_fake_env)
    next(episodes)
    assert len(multiprocessing.active_children()) == 2
    episodes.close()
    assert multiprocessing.active_children() == []


def served(make_env: object) -> Connection:
    """One end of a pipe whose other end is served by a thread in place of a process."""
    ours, theirs = multiprocessing.Pipe()
    suites = suites_for("zero", which="single")
    threading.Thread(target=_serve, args=(theirs, suites, "zero", make_env, load_player), daemon=True).start()
    return ours


def test_a_worker_plays_the_jobs_that_it_gets() -> None:
    pipe = served(make_fake_env)
    pipe.send((0, 2))
    records = list(_collect([pipe], iter([(0, 5), (0, 1)])))
    assert [record.episode for record in records] == [2, 5, 1]
    pipe.close()


def test_what_a_worker_cannot_do_reaches_the_caller() -> None:
    pipe = served(make_broken_env)
    pipe.send((0, 0))
    with pytest.raises(MeshError, match="mug: the mesh has no faces"):
        list(_collect([pipe], iter([])))


def test_a_worker_that_dies_is_one_sentence() -> None:
    ours, theirs = multiprocessing.Pipe()
    theirs.close()
    with pytest.raises(WorkerDiedError, match="a worker process died; if memory ran out"):
        list(_collect([ours], iter([])))
