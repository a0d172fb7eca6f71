"""Grasps of objects that move: tries that go on, networks that learn them, files that fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import tr_grasp.cli as cli
from tests.grasps.things import brick
from tr_grasp.errors import GraspError
from tr_grasp.grasps import Grasps, GraspSet, shape_key, shipped_grasp_set
from tr_grasp.grasps.motion_aware import (
    Judgement,
    MotionAwareScorer,
    MotionLearnCfg,
    MotionTries,
    MotionTriesCfg,
    collect_motion_tries,
    judge,
    motion_aware_scorer,
    shipped_scorers,
    split,
    train_scorer,
)
from tr_grasp.grasps.motion_aware.learn import calibration_error
from tr_grasp.grasps.motion_aware.network import QualityNet, inputs

QUICK = MotionLearnCfg(epochs_n=15, batch_n=16, learning_rate=3e-3)


def some_grasps(n: int = 6) -> GraspSet:
    rng = np.random.default_rng(0)
    q = rng.normal(size=(n, 4))
    hands = Grasps(rng.uniform(-0.05, 0.05, (n, 3)), q / np.linalg.norm(q, axis=1)[:, None], np.full(n, 0.05))
    key = shape_key(brick(), "robotiq_2f85")
    return GraspSet("brick", "robotiq_2f85", hands, np.full(n, 50), np.full(n, 50), key)


class HoldsAgainst:
    """A grasp holds unless the object runs fast along +x."""

    def __init__(self) -> None:
        self.calls = 0

    def __call__(self, grasps, rng, velocity_mps=None):
        self.calls += 1
        return velocity_mps[:, 0] < 0.03


def tries_of(n: int, tmp_path, **changes) -> MotionTries:
    return collect_motion_tries(
        some_grasps(), HoldsAgainst(), MotionTriesCfg(tries_n=n, **changes), tmp_path / "tries.npz"
    )


def test_velocities_cover_all_directions_and_the_speeds_asked_for(tmp_path):
    tries = tries_of(2000, tmp_path, speed_mps=(0.02, 0.07))
    speed = np.linalg.norm(tries.velocity_mps, axis=1)
    assert (speed.min(), speed.max()) == pytest.approx((0.02, 0.07), abs=1e-3)
    octants = np.floor(np.arctan2(tries.velocity_mps[:, 1], tries.velocity_mps[:, 0]) / (np.pi / 4))
    assert np.bincount(octants.astype(int) + 4).min() > 150
    assert set(tries.grasp.tolist()) == set(range(6))


def test_tries_that_were_stopped_go_on_and_are_the_same(tmp_path):
    whole = tries_of(300, tmp_path)
    (tmp_path / "other").mkdir()
    tries_of(100, tmp_path / "other")
    hands = HoldsAgainst()
    resumed = collect_motion_tries(some_grasps(), hands, MotionTriesCfg(tries_n=300), tmp_path / "other" / "tries.npz")
    assert hands.calls == 2
    np.testing.assert_array_equal(resumed.velocity_mps.astype(np.float32), whole.velocity_mps.astype(np.float32))
    np.testing.assert_array_equal(resumed.held, whole.held)


def test_tries_of_another_set_and_damaged_files_are_refused(tmp_path):
    tries_of(100, tmp_path)
    with pytest.raises(GraspError, match="tries of another grasp set or other settings"):
        collect_motion_tries(some_grasps(5), HoldsAgainst(), MotionTriesCfg(), tmp_path / "tries.npz")
    (tmp_path / "tries.npz").write_bytes(b"nothing")
    with pytest.raises(GraspError, match="holds no tries, or is damaged"):
        tries_of(100, tmp_path)


@pytest.mark.parametrize("network", ["ours", "thesis"])
def test_a_network_learns_what_is_learnable(network, tmp_path):
    scorer, judgement = train_scorer(some_grasps(), tries_of(1000, tmp_path), replace(QUICK, network=network))
    assert judgement.tries_n == 200
    assert judgement.accuracy > max(judgement.majority + 0.05, 0.9)
    back, ahead = (scorer.score(some_grasps().grasps, [speed, 0.0, 0.5]).min() for speed in (-0.1, 0.1))
    assert back > 0.8 > 0.3 > ahead


def test_the_thesis_network_has_its_size_and_a_softmax():
    network = QualityNet("thesis")
    assert [tuple(layer.weight.shape) for layer in network.layers[::2]] == [(512, 16), (512, 512), (2, 512)]
    rows = inputs("thesis", some_grasps().grasps, np.full((6, 2), 0.05))
    logits = network.layers(rows)
    np.testing.assert_allclose(network(rows).sigmoid().detach(), logits.softmax(1)[:, 1].detach(), atol=1e-6)
    assert rows[0, 14:].tolist() == pytest.approx([np.pi / 4, 0.05 * np.sqrt(2)])


def test_ours_does_not_tell_a_hand_from_itself_turned_by_half_and_has_no_jump_in_angle():
    hands = some_grasps().grasps
    w, x, y, z = hands.q_wxyz.T
    turned = Grasps(hands.position_m, np.stack([-z, y, -x, w], 1), hands.width_m)
    velocity = np.random.default_rng(1).normal(0, 0.05, (6, 2))
    np.testing.assert_allclose(inputs("ours", turned, velocity), inputs("ours", hands, velocity), atol=1e-5)
    above, below = (np.tile([-0.05, sign * 1e-9], (6, 1)) for sign in (1, -1))
    np.testing.assert_allclose(inputs("ours", hands, above), inputs("ours", hands, below), atol=1e-5)


def test_judging_counts_by_hand():
    class Fixed(MotionAwareScorer):
        def score(self, grasps, velocity_obj_mps):
            return np.array([0.9, 0.8, 0.4, 0.2])

    found = Fixed("brick", some_grasps().shape_key, QualityNet("ours"), 0.1)
    tries = MotionTries(np.zeros(4, int), np.zeros((4, 2)), np.array([True, False, True, True]))
    # Right on the first alone: held 1 of 3, not held 0 of 1.
    brier, calibration = (0.01 + 0.64 + 0.36 + 0.64) / 4, (0.1 + 0.8 + 0.6 + 0.8) / 4
    expected = Judgement(4, 1, 3, pytest.approx(1 / 6), pytest.approx(brier), pytest.approx(calibration))
    assert judge(found, some_grasps(), tries) == expected
    assert expected.majority == 0.75


def test_whoever_says_the_share_that_holds_is_calibrated():
    held = np.arange(100) % 10 < 7
    assert calibration_error(np.full(100, 0.7), held) == pytest.approx(0.0)
    assert calibration_error(np.full(100, 0.9), held) == pytest.approx(0.2)
    assert calibration_error(np.where(held, 1.0, 0.0), held) == pytest.approx(0.0)


def test_the_split_shares_nothing_and_few_tries_are_refused():
    learned, kept = split(100, QUICK)
    assert sorted([*learned, *kept]) == list(range(100))
    assert len(kept) == 20
    with pytest.raises(GraspError, match="2 tries are too few"):
        split(2, QUICK)


def test_a_scorer_comes_back_from_its_file_and_refuses_other_objects(tmp_path):
    scorer, _ = train_scorer(some_grasps(), tries_of(100, tmp_path), replace(QUICK, epochs_n=1))
    again = MotionAwareScorer.load(scorer.save(tmp_path / "brick.motion.safetensors"))
    score = again.score(some_grasps().grasps, [0.05, 0.02])
    np.testing.assert_array_equal(score, scorer.score(some_grasps().grasps, [0.05, 0.02]))
    # Faster than was ever tried counts as the fastest.
    np.testing.assert_allclose(again.score(some_grasps().grasps, [5.0, 0]), again.score(some_grasps().grasps, [9.0, 0]))
    with pytest.raises(GraspError, match="another shape or gripper"):
        again.require_for(shipped_grasp_set("004_sugar_box"))
    with pytest.raises(GraspError, match="must be finite"):
        again.score(some_grasps().grasps, [np.nan, 0.0])
    with pytest.raises(GraspError, match="no motion-aware scorer at"):
        motion_aware_scorer(tmp_path / "none.safetensors")


@pytest.mark.parametrize("name", shipped_scorers())
def test_shipped_scorers_fit_the_shipped_sets_and_prefer_slow_objects(name):
    grasps = shipped_grasp_set(name)
    scorer = motion_aware_scorer(name).require_for(grasps)
    slow, fast = (scorer.score(grasps.grasps, [speed, 0.0]).mean() for speed in (0.01, 0.15))
    assert slow > 0.9
    assert slow > fast
    assert scorer.record["command"].startswith(f"tr-grasp grasps motion train {name}")
    assert "dirty" not in scorer.record["commit"]


@pytest.mark.sim
def test_a_hand_meets_an_object_that_moves_and_misses_one_that_runs_away():
    from tests.envs.test_grasp_trials import side_grasp, trials

    hands, many = trials("robotiq_2f85"), side_grasp("robotiq_2f85", *[(0, 0, 0)] * 4)
    # Fingers close along x, about 2 cm free on either side; the hand comes along -y.
    velocity = np.array([[0.0, 0, 0], [0.02, 0, 0], [0, 0.02, 0], [0.5, 0, 0]])
    assert hands(many, np.random.default_rng(0), velocity).tolist() == [True, True, True, False]


@pytest.mark.sim
def test_the_command_trains_and_judges(tmp_path, capsys):
    out = tmp_path / "new" / "s.motion.safetensors"
    flags = ["--tries.tries-n", "12", "--trial.parallel-n", "48", "--learn.epochs-n", "1"]
    assert cli.main(["grasps", "motion", "train", "004_sugar_box", "--out", str(out), *flags]) == 0
    assert MotionAwareScorer.load(out).record["tries_n"] == 12
    assert cli.main(["grasps", "motion", "train", "004_sugar_box", "--out", str(out), *flags]) == 2
    capsys.readouterr()
    kept = ["--kept", str(out.with_suffix(".tries.npz")), "--tries.seed", "0", "--tries.tries-n", "12"]
    assert cli.main(["grasps", "motion", "evaluate", str(out), "004_sugar_box", *kept]) == 0
    assert capsys.readouterr().out.splitlines()[2].startswith("004_sugar_box")


@pytest.mark.parametrize(
    ("args", "sentence"),
    [
        (["trian"], "unknown verb of grasps motion 'trian'; did you mean 'train'?"),
        (["train", "004_sugar_box", "--tries.tries-n", "0"], "tries_n must be at least 1, got 0"),
        (["train", "004_sugar_box", "--tries.speed-mps", "0.2", "0.1"], "the smaller one first"),
        (["train", "004_sugar_box", "--learn.test-share", "1"], "test_share must lie between 0 and 1, got 1.0"),
        (["evaluate", "nothing", "004_sugar_box"], "unknown object with a shipped motion-aware scorer 'nothing'"),
    ],
)
def test_a_mistake_is_one_sentence(args, sentence, capsys):
    assert cli.main(["grasps", "motion", *args]) == 2
    assert sentence in capsys.readouterr().err
