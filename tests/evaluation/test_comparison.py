from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.evaluation.test_records import BOX
from tr_grasp.errors import ConfigError
from tr_grasp.evaluation.comparison import compare, paired
from tr_grasp.evaluation.records import EpisodeRecord
from tr_grasp.evaluation.statistics import PairedCounts, fisher_exact_test, mcnemar_exact_test


def episodes(successes: list[bool], *, first_seed: int = 0, suite: str = "single") -> list[EpisodeRecord]:
    return [
        replace(BOX, suite=suite, episode=i, seed=first_seed + i, success=success, objects=(f"box_{first_seed + i}",))
        for i, success in enumerate(successes)
    ]


def test_the_same_scenes_are_compared_as_pairs() -> None:
    a, b = episodes([True] * 9 + [False]), episodes([False] * 9 + [True])
    (comparison,) = compare(a, b)
    assert comparison.test == "McNemar, exact"
    assert comparison.p == pytest.approx(22 / 1024)
    assert comparison.difference == pytest.approx(0.8)
    assert comparison.verdict == "The difference is significant at 5 % (p = 0.021): A is better."


def test_other_seeds_are_compared_as_independent_episodes() -> None:
    a, b = episodes([True] * 3 + [False]), episodes([True] + [False] * 3, first_seed=100)
    (comparison,) = compare(a, b)
    assert comparison.test == "Fisher, exact"
    assert comparison.p == pytest.approx(34 / 70)
    assert "not significant at 5 % (p = 0.49)" in comparison.verdict
    assert f"about {comparison.needed} episodes of each" in comparison.verdict


def test_the_same_seed_with_other_objects_is_no_pair() -> None:
    a = episodes([True, False])
    b = [replace(record, objects=("mug",)) for record in a]
    assert paired(a, b) is None
    assert compare(a, b)[0].test == "Fisher, exact"


def test_only_shared_scenes_are_compared() -> None:
    (comparison,) = compare(episodes([True] * 10), episodes([True, False, True]))
    assert (comparison.a.n, comparison.b.n) == (3, 3)


def test_a_draw_needs_no_more_episodes() -> None:
    (comparison,) = compare(episodes([True, False]), episodes([False, True]))
    assert comparison.needed is None
    assert comparison.verdict.startswith("Neither is ahead")


def test_suites_are_compared_one_by_one() -> None:
    a = episodes([True], suite="single") + episodes([True], suite="pile")
    b = episodes([True], suite="pile") + episodes([False], suite="single")
    assert [(c.suite, c.difference) for c in compare(a, b)] == [("single", 1.0), ("pile", 0.0)]
    with pytest.raises(ConfigError, match="no suite in common: A has single, pile, B has scattered"):
        compare(a, episodes([True], suite="scattered"))


@given(st.lists(st.tuples(st.booleans(), st.booleans()), min_size=1, max_size=40))
def test_pairs_are_counted_as_by_hand(outcomes: list[tuple[bool, bool]]) -> None:
    cells = PairedCounts(
        both=outcomes.count((True, True)),
        only_a=outcomes.count((True, False)),
        only_b=outcomes.count((False, True)),
        neither=outcomes.count((False, False)),
    )
    one, other = (list(flags) for flags in zip(*outcomes, strict=True))
    (comparison,) = compare(episodes(one), episodes(other))
    assert comparison.p == pytest.approx(mcnemar_exact_test(cells))
    assert comparison.difference == pytest.approx((cells.only_a - cells.only_b) / len(outcomes))
    (apart,) = compare(episodes(one), episodes(other, first_seed=1000))
    assert apart.p == pytest.approx(fisher_exact_test(apart.a, apart.b))
