from __future__ import annotations

import json
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.evaluation.test_records import BOX, records
from tr_grasp.errors import ConfigError
from tr_grasp.evaluation.records import EpisodeRecord
from tr_grasp.evaluation.summary import by_family, by_number, summarise

LOST = replace(BOX, episode=1, success=False, outcome="slipped", steps=100, reward=56.5, lifted=False)


def test_three_episodes_by_hand() -> None:
    summary = summarise("single", [BOX, LOST, replace(BOX, steps=16, reward=400.07)])
    assert summary.success == (2, 3)
    assert summary.reward == pytest.approx((285.5, (78661.5098 / 3) ** 0.5))
    assert summary.steps == pytest.approx((130 / 3, 40.077703))
    assert summary.steps_of_successes == pytest.approx((15, 1))
    assert summary.outcomes == {"lifted": 2, "slipped": 1}


def test_without_success_there_is_no_length_of_successes() -> None:
    summary = summarise("single", [LOST])
    assert summary.steps_of_successes is None
    assert json.loads(json.dumps(summary.as_json()))["steps_of_successes"] is None


def test_an_empty_suite_has_no_summary() -> None:
    with pytest.raises(ConfigError, match="suite 'pile' has no finished episode"):
        summarise("pile", [])


def test_an_episode_counts_once_for_each_family_in_it() -> None:
    pair = replace(BOX, families=("mug", "box", "mug"), objects_n=3)
    assert by_family([pair, LOST]) == {"box": (1, 2), "mug": (1, 1)}
    assert by_number([pair, LOST]) == {"1": (0, 1), "3": (1, 1)}


@given(st.lists(records, min_size=1, max_size=8))
def test_every_episode_has_one_outcome_and_one_number_of_objects(episodes: list[EpisodeRecord]) -> None:
    assert sum(summarise("any", episodes).outcomes.values()) == len(episodes)
    assert sum(counts.n for counts in by_number(episodes).values()) == len(episodes)
