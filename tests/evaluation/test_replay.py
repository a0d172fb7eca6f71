from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from tests.evaluation.fake_task import make_fake_env
from tests.evaluation.test_records import BOX
from tests.evaluation.test_rollouts import suites_for
from tr_grasp.evaluation.players import load_player
from tr_grasp.evaluation.records import EpisodeRecord
from tr_grasp.evaluation.replay import Recorder, ReplayStep, choose_episodes, record_episode
from tr_grasp.evaluation.replay_view import BAND_PX, ReplayView, action_text, gripper_of
from tr_grasp.evaluation.rollouts import run_episode


def episode(number: int, outcome: str) -> EpisodeRecord:
    return replace(BOX, episode=number, seed=number, outcome=outcome, success=outcome == "lifted")


def test_recording_changes_nothing() -> None:
    suite = suites_for("random", which="scattered")[0]
    env, policy = make_fake_env(suite.env), load_player("random").policy
    plain = run_episode(env, policy, suite, 3)
    record, steps = record_episode(env, policy, suite, 3)
    assert record == plain
    assert [step.step for step in steps] == list(range(record.steps + 1))
    assert steps[-1].outcome == record.outcome
    assert steps[-1].stages == (record.reached, record.touched, record.grasped, record.lifted)


def test_recorded_instants_do_not_change_afterwards() -> None:
    env, recorder = make_fake_env(suites_for("scripted", which="single")[0].env), Recorder()
    state = env.reset()
    action = torch.ones(5)
    recorder(env, 1, action, state)
    codes = state["octree"][-1].codes.clone()
    for tensor in (action, state["proprio"], state["octree"].codes):
        tensor.zero_()
    (step,) = recorder.steps
    assert step.action is not None
    assert step.action.tolist() == [1] * 5
    assert step.proprio[0] == 1
    assert torch.equal(step.octree.codes, codes)


def test_a_frame_shows_the_scene_and_the_octree_above_the_text() -> None:
    suite = suites_for("scripted", which="single")[0]
    _, steps = record_episode(make_fake_env(suite.env), load_player("scripted").policy, suite, 0)
    frames = list(ReplayView(suite.env).frames(steps))
    assert {frame.shape for frame in frames} == {(320 + BAND_PX, 640, 3)}
    assert (frames[0][:320, :320] == steps[0].image).all()
    red = (frames[0][:320, 320:].astype(int) @ [2, -1, -1]) > 150
    assert red.any()
    assert (frames[-1][320:, 400:] != frames[-2][320:, 400:]).any(), "the last frame tells the outcome"


def test_a_step_in_words() -> None:
    step = ReplayStep(
        step=12,
        image=np.zeros((2, 2, 3), np.uint8),
        octree=None,
        proprio=np.zeros(10, np.float32),
        action=np.array([0.31, -1, 0, 0.5, -0.2], np.float32),
        stages=(True, False, False, False),
        outcome="",
    )
    assert action_text(step) == "step 12    x +0.31   y -1.00   z +0.00   turn +0.50   close"
    assert action_text(replace(step, step=0, action=None)) == "step 0    start"


def test_the_gripper_is_read_from_the_proprioception() -> None:
    """Gripper reading, tcp, first and second column of the rotation."""
    gripper = gripper_of(np.array([1.2, 0.5, 0.1, 0.2, 1, 0, 0, 0, -1, 0], np.float32))
    assert gripper.opening == 1
    assert gripper.tcp_m.tolist() == pytest.approx([0.5, 0.1, 0.2])
    assert gripper.closing_axis.tolist() == [0, -1, 0]


def test_half_the_films_are_failures_of_different_kinds() -> None:
    ends = ["lifted", "slipped", "slipped", "lifted", "lost", "lifted", "slipped"]
    chosen = choose_episodes([episode(i, end) for i, end in enumerate(ends)], 4)
    assert [(r.episode, r.outcome) for r in chosen] == [(1, "slipped"), (4, "lost"), (0, "lifted"), (3, "lifted")]


@given(st.lists(st.sampled_from(["lifted", "slipped", "lost"]), max_size=12), st.integers(0, 6))
def test_as_many_films_as_asked_for_if_there_are_so_many_episodes(ends: list[str], n: int) -> None:
    episodes = [episode(i, end) for i, end in enumerate(ends)]
    chosen = choose_episodes(episodes, n)
    assert len(chosen) == min(n, len(episodes)) == len({record.episode for record in chosen})
    failures = sum(not record.success for record in chosen)
    assert failures >= min(ends.count("slipped") + ends.count("lost"), n // 2)
    assert len(chosen) - failures >= min(ends.count("lifted"), n // 2)
