import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tr_grasp.configs import RewardCfg
from tr_grasp.envs.outcome import Outcome, outcome_of
from tr_grasp.envs.rewards import completed_stages, reward_terms

flags = st.lists(st.booleans(), min_size=4, max_size=4).map(np.array)
CFG = RewardCfg()


@given(history=st.lists(flags, max_size=20))
def test_stages_stay_complete_come_in_order_and_pay_at_most_400(history):
    done, paid = np.zeros(4, bool), 0.0
    for now in history:
        after = completed_stages(done, now)
        assert (after | ~done).all()
        assert (np.diff(after.astype(int)) <= 0).all()
        paid += sum(reward_terms(done, after, False, CFG).values())
        done = after
    assert paid <= 400 - 0.005 * len(history) + 1e-9
    assert abs(paid - (sum(7.0**k for k in range(4) if done[k]) - 0.005 * len(history))) < 1e-9


def test_all_stages_in_one_step_pay_1_7_49_and_343():
    terms = reward_terms(np.zeros(4, bool), completed_stages(np.zeros(4, bool), np.ones(4, bool)), False, CFG)
    assert (terms["reach"], terms["touch"], terms["grasp"], terms["lift"]) == (1.0, 7.0, 49.0, 343.0)
    assert sum(terms.values()) == pytest.approx(399.995)


def test_a_grasp_without_a_touch_before_it_pays_nothing():
    after = completed_stages(np.array([True, False, False, False]), np.array([True, False, True, True]))
    np.testing.assert_array_equal(after, [True, False, False, False])


def test_touching_the_table_costs_one():
    none = np.zeros(4, bool)
    assert sum(reward_terms(none, none, True, CFG).values()) == pytest.approx(-1.005)


@pytest.mark.parametrize(
    ("stages", "holding", "all_out", "expected"),
    [
        ((False, False, False, False), False, False, Outcome.NEVER_REACHED),
        ((True, False, False, False), False, False, Outcome.NEVER_TOUCHED),
        ((True, True, False, False), False, False, Outcome.NEVER_GRASPED),
        ((True, True, True, False), False, False, Outcome.LOST),
        ((True, True, True, False), True, False, Outcome.NOT_LIFTED),
        ((True, True, False, False), False, True, Outcome.FELL_OUT),
        ((True, True, True, True), True, True, Outcome.LIFTED),
    ],
)
def test_each_way_to_end_has_its_name(stages, holding, all_out, expected):
    assert outcome_of(stages, holding, all_out) is expected
    assert expected.is_success == (expected is Outcome.LIFTED)
    assert expected.label
