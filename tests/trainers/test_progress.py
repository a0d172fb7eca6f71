from __future__ import annotations

import torch
from tensordict import TensorDict

from tr_grasp.trainers.progress import Averages, RecentEpisodes, clock_text, curve, progress_line


def chunk(done: list[bool], success: list[bool], reward: list[float], steps: list[int]) -> TensorDict:
    n = len(done)
    following = {
        "done": torch.tensor(done)[:, None],
        "success": torch.tensor(success)[:, None],
        "episode_reward": torch.tensor(reward)[:, None],
        "step_count": torch.tensor(steps)[:, None],
    }
    return TensorDict({"next": TensorDict(following, [n])}, [n])


def test_only_ended_episodes_count():
    episodes = RecentEpisodes()
    assert episodes.summary() == {}
    episodes.observe(chunk([False, True, True], [True, True, False], [9.0, 4.0, 2.0], [1, 2, 1]))
    assert episodes.summary() == {"train/success": 0.5, "train/reward": 3.0, "train/steps": 1.5, "train/episodes": 2}


def test_only_the_last_hundred_count():
    episodes = RecentEpisodes()
    for success in [False] * 50 + [True] * 100:
        episodes.observe(chunk([True], [success], [0.0], [1]))
    assert episodes.summary()["train/success"] == 1.0
    assert episodes.finished == 150
    other = RecentEpisodes()
    other.load_state_dict(episodes.state_dict())
    assert other.summary() == episodes.summary()


def test_averages_start_anew_when_they_were_taken():
    averages = Averages()
    assert averages.take("x") == {}
    averages.add({"loss": torch.tensor(1.0)})
    averages.add({"loss": torch.tensor(3.0)})
    assert averages.take("x") == {"x/loss": 2.0}
    assert averages.take("x") == {}


def test_the_line_says_how_far_how_well_how_fast_and_how_long():
    row = {
        "env_steps": 1500,
        "updates": 400,
        "wall_s": 75.0,
        "train/success": 0.87,
        "rate/env_steps_per_s": 51.3,
        "rate/updates_per_s": 9.96,
    }
    assert progress_line(row, 20_000, 3700.0) == (
        "   1500/20000 steps |    400 updates | success  87 % of last 100 | 51 steps/s, 10.0 updates/s | "
        "1:15 elapsed | 1:01:40 left"
    )


def test_times_are_readable():
    assert [clock_text(s) for s in (0, 61, 3599.9, 3600)] == ["0:00", "1:01", "59:59", "1:00:00"]


def test_a_curve_keeps_what_a_record_needs():
    rows = [{"env_steps": 5, "wall_s": 1.23456, "learner/loss": 3.0, "train/success": 0.5}]
    assert curve(rows) == [{"env_steps": 5, "wall_s": 1.2346, "train/success": 0.5}]
