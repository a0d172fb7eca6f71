from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from tests.grasps.things import HoldsWith, brick
from tr_grasp.errors import GraspError
from tr_grasp.grasps import BuildCfg, HandMotion, TrialCfg, build_grasp_set, forget_tally

CFG = BuildCfg(candidates_n=600, screen_n=80, finalists_n=40, tries=30, keep_n=12)


def build(cfg=CFG, trial=None, **kwargs):
    return build_grasp_set(brick(), "robotiq_2f85", trial or HoldsWith(), cfg, **kwargs)


def test_the_best_come_first_and_bad_ones_stay_out():
    made = build()
    assert len(made) == 12
    assert (made.grasps.position_m[:, 2] > 0).all()  # the others hold in half of their tries
    assert (np.diff(made.robustness) <= 0).all()
    assert (made.tries == CFG.tries).all()


def test_the_same_seed_makes_the_same_set_and_another_another():
    first, again = build(), build()
    np.testing.assert_array_equal(first.grasps.position_m, again.grasps.position_m)
    other = build(dataclasses.replace(CFG, seed=1))
    assert not np.array_equal(first.grasps.position_m, other.grasps.position_m)


class Stops(HoldsWith):
    def __init__(self, after: int) -> None:
        super().__init__()
        self.after = after

    def __call__(self, grasps, rng):
        if self.calls == self.after:
            raise KeyboardInterrupt
        return super().__call__(grasps, rng)


@pytest.mark.parametrize("after", [1, 2, 9])
def test_an_interrupted_build_goes_on_and_ends_as_if_nothing_had_been(tmp_path, after):
    file = tmp_path / "tally"
    with pytest.raises(KeyboardInterrupt):
        build(trial=Stops(after), resume_file=file)
    rest = HoldsWith()
    resumed, whole = build(trial=rest, resume_file=file), HoldsWith()
    straight = build(trial=whole)
    assert rest.calls == whole.calls - after
    np.testing.assert_array_equal(resumed.grasps.position_m, straight.grasps.position_m)
    np.testing.assert_array_equal(resumed.successes, straight.successes)
    forget_tally(file)
    assert not list(tmp_path.iterdir())


def test_a_tally_of_another_build_or_a_broken_one_is_not_taken_up(tmp_path):
    file = tmp_path / "tally"
    build(resume_file=file)
    other, broken = HoldsWith(), HoldsWith()
    build(dataclasses.replace(CFG, seed=5), trial=other, resume_file=file)
    assert other.calls > 20
    for path in tmp_path.iterdir():
        path.write_bytes(b"PK half a file")
    build(trial=broken, resume_file=file)
    assert broken.calls > 20


def test_a_grasp_that_cannot_reach_the_rate_any_more_is_dropped():
    cfg = dataclasses.replace(CFG, screen_tries=1, keep_from=0.9)
    made = build(cfg)
    full = cfg.screen_n + cfg.finalists_n * cfg.tries
    assert made.statistics["tries_n"] < full


def test_no_grasp_that_holds_is_an_error_with_the_best_rate():
    with pytest.raises(GraspError, match=r"held in 100 % of its tries, the best in \d+ %"):
        build(dataclasses.replace(CFG, keep_from=1.0), trial=HoldsWith(lambda g: np.full(len(g), 0.5)))


def test_nothing_that_holds_at_all_is_the_same_error():
    with pytest.raises(GraspError, match="the best in 0 %"):
        build(trial=HoldsWith(lambda g: np.zeros(len(g))))


def test_progress_counts_up_to_the_end():
    seen = []
    build(progress=lambda *args: seen.append(args))
    assert {stage for stage, _, _ in seen} == {"screening", "ranking"}
    assert seen[-1][1] == seen[-1][2]


@pytest.mark.parametrize("field", ["candidates_n", "tries", "keep_n"])
def test_counts_below_one_are_refused(field):
    with pytest.raises(GraspError, match=f"{field} must be at least 1, got 0"):
        dataclasses.replace(CFG, **{field: 0})


def test_a_trial_without_lift_is_refused():
    with pytest.raises(GraspError, match="lift_m must be positive"):
        TrialCfg(lift_m=0.0)


def test_the_hand_comes_straight_waits_lifts_shakes_and_stands():
    cfg = TrialCfg()
    motion = HandMotion(cfg, close_s=0.5)
    assert motion.back_at(0.0) == cfg.approach_m
    assert motion.back_at(cfg.approach_s) == 0.0
    np.testing.assert_array_equal(motion.moved_at(cfg.approach_s + 0.5), 0.0)
    np.testing.assert_allclose(motion.moved_at(motion.duration_s), [0.0, 0.0, cfg.lift_m], atol=1e-12)
    times = np.linspace(0.0, motion.duration_s, 400)
    aside = np.array([motion.moved_at(time)[0] for time in times])
    np.testing.assert_allclose([aside.min(), aside.max()], np.array([-1, 1]) * cfg.shake_m / np.sqrt(2), rtol=1e-2)
