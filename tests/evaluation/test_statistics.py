from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tr_grasp.evaluation.statistics import (
    Counts,
    PairedCounts,
    difference_interval,
    episodes_needed,
    fisher_exact_test,
    mcnemar_exact_test,
    mean_std,
    paired_difference_interval,
    paired_episodes_needed,
    two_proportion_z_test,
    wilson_interval,
)


@st.composite
def counts(draw: st.DrawFn, at_least: int = 1) -> Counts:
    n = draw(st.integers(at_least, 400))
    return Counts(draw(st.integers(0, n)), n)


@pytest.mark.parametrize(
    ("successes", "low", "high"),
    [(91, 38.7, 52.4), (81, 33.9, 47.4), (161, 74.5, 85.4), (175, 82.2, 91.4)],
)
def test_the_thesis_success_rates_out_of_200_have_these_wilson_intervals(
    successes: int, low: float, high: float
) -> None:
    interval = wilson_interval(Counts(successes, 200))
    assert (round(100 * interval.low, 1), round(100 * interval.high, 1)) == (low, high)


@given(counts())
def test_a_wilson_interval_ends_where_the_score_test_rejects(c: Counts) -> None:
    """The definition: at each end, |rate - p| is 1.96 standard deviations of the hypothesis p."""
    for p in wilson_interval(c):
        if 1e-9 < p < 1 - 1e-9:
            assert abs(c.rate - p) == pytest.approx(1.959964 * math.sqrt(p * (1 - p) / c.n), rel=1e-4, abs=1e-9)


def test_without_episodes_every_rate_is_possible() -> None:
    assert wilson_interval(Counts(0, 0)) == (0.0, 1.0)
    assert math.isnan(Counts(0, 0).rate)


def test_the_thesis_comparisons_are_not_significant() -> None:
    colour, none = Counts(91, 200), Counts(81, 200)
    ahrnet, residual = Counts(175, 200), Counts(161, 200)
    assert round(two_proportion_z_test(colour, none), 2) == 0.31
    assert round(two_proportion_z_test(ahrnet, residual), 3) == 0.056


def test_fishers_tea_tasting_lady_gets_her_p_value() -> None:
    """Three of four cups right: 34/70 two-sided (Fisher 1935)."""
    assert fisher_exact_test(Counts(3, 4), Counts(1, 4)) == pytest.approx(34 / 70)


@given(counts(), counts())
def test_swapping_the_policies_keeps_p_and_mirrors_the_interval(a: Counts, b: Counts) -> None:
    assert two_proportion_z_test(a, b) == pytest.approx(two_proportion_z_test(b, a))
    assert fisher_exact_test(a, b) == pytest.approx(fisher_exact_test(b, a))
    there, back = difference_interval(a, b), difference_interval(b, a)
    assert (there.low, there.high) == pytest.approx((-back.high, -back.low))
    assert there.low - 1e-12 <= a.rate - b.rate <= there.high + 1e-12


def test_newcombes_first_example_is_reproduced() -> None:
    """56/70 against 48/80: 0.0524 to 0.3339 (Newcombe 1998, table II, method 10)."""
    interval = difference_interval(Counts(56, 70), Counts(48, 80))
    assert interval == pytest.approx((0.0524, 0.3339), abs=5e-5)


def test_mcnemar_counts_only_disagreements() -> None:
    """Nine against one: 2 (1 + 10) / 2^10, whatever both did together."""
    expected = 2 * (1 + 10) / 2**10
    assert mcnemar_exact_test(PairedCounts(0, 9, 1, 0)) == pytest.approx(expected)
    assert mcnemar_exact_test(PairedCounts(500, 9, 1, 300)) == pytest.approx(expected)
    assert mcnemar_exact_test(PairedCounts(20, 0, 0, 3)) == 1.0


def test_a_paired_interval_by_hand() -> None:
    """n = 98, only_a 19, only_b 9: (20 - 10)/100 +- 1.96 sqrt((0.2 + 0.1 - 0.01)/100)."""
    half = 1.959964 * math.sqrt(0.29 / 100)
    assert paired_difference_interval(PairedCounts(40, 19, 9, 30)) == pytest.approx((0.1 - half, 0.1 + half), abs=1e-6)


@given(st.tuples(*[st.integers(0, 60)] * 4))
def test_swapping_paired_policies_keeps_p_and_mirrors_the_interval(cells: tuple[int, int, int, int]) -> None:
    there, back = PairedCounts(*cells), PairedCounts(cells[0], cells[2], cells[1], cells[3])
    assert mcnemar_exact_test(there) == pytest.approx(mcnemar_exact_test(back))
    low, high = paired_difference_interval(there)
    assert (low, high) == pytest.approx(tuple(-v for v in reversed(paired_difference_interval(back))))


def test_colour_against_none_would_need_about_1600_episodes_each() -> None:
    """Fleiss' formula with z = 1.96 and 0.8416 and the mean rate 0.43, then his correction, written out."""
    spread = 1.959964 * math.sqrt(2 * 0.43 * 0.57) + 0.841621 * math.sqrt(0.455 * 0.545 + 0.405 * 0.595)
    n = (spread / 0.05) ** 2
    assert 1500 < n < 1600
    assert episodes_needed(0.455, 0.405) == math.ceil(n / 4 * (1 + math.sqrt(1 + 4 / (0.05 * n))) ** 2)
    assert episodes_needed(0.5, 0.5) is None


def test_six_wins_in_a_row_are_the_fewest_that_tell() -> None:
    """2 / 2^5 is above 5 %, 2 / 2^6 below."""
    assert mcnemar_exact_test(PairedCounts(0, 5, 0, 0)) > 0.05 > mcnemar_exact_test(PairedCounts(0, 6, 0, 0))
    assert paired_episodes_needed(PairedCounts(0, 4, 0, 0)) == 6
    assert paired_episodes_needed(PairedCounts(1, 4, 0, 0)) == 8  # 6 of the 0.8 that disagree


def test_the_needed_episodes_give_the_promised_power() -> None:
    """Simulated: of experiments with that many episodes about 80 % come out significant."""
    n = episodes_needed(0.9, 0.8)
    assert n is not None
    rng = np.random.default_rng(0)
    pairs = zip(rng.binomial(n, 0.9, 1000), rng.binomial(n, 0.8, 1000), strict=True)
    significant = np.mean([fisher_exact_test(Counts(int(a), n), Counts(int(b), n)) < 0.05 for a, b in pairs])
    assert 0.76 < significant < 0.84


def test_the_needed_paired_episodes_give_the_promised_power() -> None:
    n = paired_episodes_needed(PairedCounts(70, 20, 10, 0))
    assert n is not None
    rng = np.random.default_rng(1)
    cells = rng.multinomial(n, [0.7, 0.2, 0.1, 0.0], size=1000)
    significant = np.mean([mcnemar_exact_test(PairedCounts(*map(int, row))) < 0.05 for row in cells])
    assert 0.72 < significant < 0.84
    assert paired_episodes_needed(PairedCounts(5, 3, 3, 5)) is None


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=30))
def test_mean_and_deviation_are_numpys(values: list[float]) -> None:
    assert mean_std(values) == pytest.approx((np.mean(values), np.std(values)), abs=1e-9)


def test_no_values_have_no_mean() -> None:
    assert mean_std([]) is None
