"""Evaluations of Task II: nothing is lost, nothing counts twice, and the tables say what the trials were."""

import json
from dataclasses import asdict, replace

import pytest

from tr_grasp.configs.dynamic import DYNAMIC_OBJECTS, THESIS_MOTIONS, DynamicCfg
from tr_grasp.dynamic.record import TrialRecord
from tr_grasp.dynamic.settings import GrasperCfg
from tr_grasp.errors import ConfigError
from tr_grasp.evaluation.dynamic import summary
from tr_grasp.evaluation.dynamic.log import TRIALS_FILE, TrialLog, as_csv, read_trials
from tr_grasp.evaluation.dynamic.replay import caption, choose
from tr_grasp.evaluation.dynamic.report import Report
from tr_grasp.evaluation.dynamic.run import LISTS_FILE, Contender, Plan, evaluate, read_lists
from tr_grasp.evaluation.dynamic.thesis import ALL, PREDICTORS, THESIS, best
from tr_grasp.evaluation.dynamic.variations import variations
from tr_grasp.provenance import Provenance

OURS = Contender("intercept", GrasperCfg(), DynamicCfg())
THEIRS = Contender("thesis", GrasperCfg.thesis(), DynamicCfg())
PLAN = Plan((OURS, THEIRS), ("linear", "circular"), DYNAMIC_OBJECTS[:2], (0.03, 0.05), 3)


def record_of(job) -> TrialRecord:
    """What a job would give: ours fails the first trial, theirs all but the last."""
    number = job.trial.number
    success = number > 0 if job.contender is OURS or job.contender.name == "intercept" else number == 2
    return TrialRecord(
        *job.key[:1], job.key[2], job.key[3], job.key[1], number, job.key[4], success,
        "lifted and held" if success else "closed on air", "", 2.0 + number, True, 3.0 if success else None, 6.0,
        1, 20, 0, 0.5, "{}", 1.0, 0.1,
    )  # fmt: skip


@pytest.fixture(scope="module")
def records():
    return [record_of(job) for job in PLAN.jobs()]


def test_an_evaluation_that_was_cut_off_goes_on_and_counts_every_trial_once(tmp_path):
    done = []

    def dies_after_five(job):
        if len(done) == 5:
            raise KeyboardInterrupt
        done.append(job.key)
        return record_of(job)

    with pytest.raises(KeyboardInterrupt):
        evaluate(PLAN, tmp_path, run=dies_after_five)
    file = tmp_path / TRIALS_FILE
    assert len(read_trials(tmp_path)) == 5
    file.write_text(file.read_text() + "intercept,linear,004_su")  # a row that a full disk has cut off
    seen, again = [], []

    def runs(job):
        again.append(job.key)
        return record_of(job)

    found = evaluate(PLAN, tmp_path, run=runs, on_trial=seen.append)
    keys = [job.key for job in PLAN.jobs()]
    assert len(keys) == len(set(keys)) == 2 * 2 * 2 * 2 * 3
    assert sorted(done + again) == sorted(keys)
    assert sorted(record.key for record in found) == sorted(keys)
    assert sorted(record.key for record in seen) == sorted(keys)
    assert sorted(map(repr, read_trials(tmp_path))) == sorted(map(repr, found))
    assert read_lists(tmp_path / LISTS_FILE)[0] == next(PLAN.jobs()).trial


def test_other_settings_or_another_table_are_not_mixed_in(tmp_path):
    few = replace(PLAN, contenders=(OURS,), trials_n=1)
    evaluate(few, tmp_path, run=record_of)
    other = replace(few, contenders=(replace(OURS, cfg=GrasperCfg(retry=False)),))
    with pytest.raises(ConfigError, match=r"grasper\.retry"):
        evaluate(other, tmp_path, run=record_of)
    evaluate(
        replace(few, speeds_m_s=(0.1,), contenders=(replace(other.contenders[0], name="no-retry"),)),
        tmp_path,
        run=record_of,
    )
    assert {record.method for record in read_trials(tmp_path)} == {"intercept", "no-retry"}
    (tmp_path / TRIALS_FILE).write_text("a,b\n1,2\n")
    with pytest.raises(ConfigError, match="lacks the column"):
        evaluate(few, tmp_path, run=record_of)
    with pytest.raises(ConfigError, match="does not exist"):
        read_trials(tmp_path / "nowhere")


def test_a_row_in_the_middle_that_is_damaged_is_refused(tmp_path, records):
    text = as_csv(records[:3]).splitlines()
    text[2] = text[2].replace("True", "perhaps")
    (tmp_path / TRIALS_FILE).write_text("\n".join(text) + "\n")
    with pytest.raises(ConfigError, match="line 3"), TrialLog(tmp_path):
        pass


def test_the_thesis_is_copied_right():
    """Means of the five objects are those of its own last row."""
    for predictor in PREDICTORS:
        for motion in THESIS_MOTIONS:
            cells = [THESIS[predictor].get((name, motion)) for name in DYNAMIC_OBJECTS]
            total = THESIS[predictor].get((ALL, motion))
            assert (total is None) == (None in cells)
            if total is not None:
                assert sum(cell.success for cell in cells) / 5 == pytest.approx(total.success)
                assert sum(cell.time_s for cell in cells) / 5 == pytest.approx(total.time_s, abs=2e-3)
    assert best(ALL, "linear") == (85.8, 13.7016)
    assert best(ALL, "sinusoidal") == (75.8, 17.8904)
    assert best(ALL, "bezier") is None


def test_a_cell_by_hand(records):
    cell = [r for r in records if r.method == "thesis" and r.motion == "linear" and r.speed_m_s == 0.03]
    result = summary.Result.of(cell)
    assert result.counts == (2, 6)
    assert (result.time_s, result.success_time_s, result.lifted_s) == (3.0, 4.0, 3.0)
    assert result.text == "33.3 [9.7, 70.0] / 3.0"
    assert summary.Result.of([]).text == "-"


def test_tables_have_the_shape_of_the_thesis(records):
    motions = summary.motions_of(records)
    assert motions == ["linear", "circular"]
    rows = summary.object_rows([r for r in records if r.method == "intercept" and r.speed_m_s == 0.03], motions)
    assert [row[0] for row in rows[::2]] == [*DYNAMIC_OBJECTS[:2], ALL]
    assert rows[-1] == ("  thesis, best", "85.8 / 13.7", "81.2 / 13.4")
    methods = summary.method_rows(records, motions)
    assert sorted(row[0] for row in methods[:4]) == [f"{m}, {v} cm/s" for m in ("intercept", "thesis") for v in (3, 5)]
    assert methods[-1] == ("thesis, LSTM", "85.4 / 13.9", "-")
    assert summary.reason_rows(records)[0] == ("intercept", "circular", "closed on air", "4")
    assert summary.cost_rows(records)[0][:3] == ("intercept", "24", "1.00")


def test_methods_are_compared_on_the_trials_that_both_ran(records):
    (sentence,) = summary.pair_sentences(records)
    assert sentence.startswith("intercept against thesis on 24 shared trials: +33.3 points")


def test_rankings_know_what_comes_with_the_package_for_the_plain_solids_and_nothing_of_other_objects():
    job = next(PLAN.jobs())
    assert job.method.aids.field is not None
    assert job.method.aids.scorer.object_name == job.trial.object_name
    assert replace(job, world=replace(job.world, grasps="mine")).method.aids.scorer is None


def test_each_variation_differs_from_the_method_in_what_it_is_named_for():
    base = replace(OURS, name="ours")
    assert variations(base, "none") == (base,)
    found = variations(base, "ablations")
    assert found[0] is base
    assert len({one.name for one in found}) == len(found) == 1 + 7 + 5 + 4
    for one in found[1:]:
        before, now = asdict(base.cfg), asdict(one.cfg)
        (field,) = (name for name in now if now[name] != before[name])
        word = str(now[field]) if isinstance(now[field], str) else field
        assert one.name.endswith(word.replace("_", "-"))
        assert one.world == base.world
    noisy = variations(base, "noise")
    assert [one.world.tracking.noise_m for one in noisy] == [0.0, 0.001, 0.002, 0.005]
    assert [one.name for one in variations(base, "latency")][1:] == [f"ours-latency-{ms}ms" for ms in (50, 100, 200)]


def test_many_methods_are_compared_with_the_first(records):
    rows = summary.study_rows(records)
    assert [row[:3] for row in rows] == [("intercept", "24", "66.7"), ("thesis", "24", "33.3")]
    assert rows[0][5:] == ("-", "-")
    assert rows[1][5:] == ("-33.3", "0.0078")  # of 8 trials that differ, all went one way: 2 / 2**8


def test_the_report_is_one_page_that_names_everything(records):
    source = Provenance("tr-grasp dynamic evaluate", started="now", machine="m", versions={})
    settings = {"thesis": (DynamicCfg(physics_hz=120), GrasperCfg.thesis())}
    html = Report(records, settings, source).html()
    for word in (
        "table 5.11",
        "thesis, LSTM",
        "closed on air",
        "thesis: physics_hz",
        "Success against speed",
        "</html>",
    ):
        assert word in html


@pytest.mark.filterwarnings("error")  # matplotlib warns where a plot has no room left
@pytest.mark.parametrize("methods_n", [2, 4, 17])
def test_pictures_have_room_for_every_method(records, methods_n):
    many = [replace(record, method=f"intercept, variation {i}") for i in range(methods_n) for record in records]
    html = Report(many, {}, Provenance("tr-grasp dynamic evaluate", started="now", machine="m", versions={})).html()
    assert ("Success by motion" in html) == (methods_n <= summary.FEW)
    assert ("Mean time until" in html) == (methods_n > summary.FEW)


def test_films_show_failures_and_successes_of_different_kinds(records):
    shown = choose(records, 4)
    assert [record.success for record in shown] == [False, True, False, True]
    assert len({(r.motion, r.object_name) for r in shown if r.success}) == 2
    assert choose(records, 0) == []
    good = replace(records[0], time_s=2.0, lifted_s=3.0)
    assert [caption(good, t).split()[-1] for t in (0.0, 2.5, 9.0)] == ["reaching", "grasping", "lifted"]


def test_lists_that_are_none_are_refused(tmp_path):
    path = tmp_path / LISTS_FILE
    path.write_text(json.dumps([{"motion": "linear"}]))
    with pytest.raises(ConfigError, match="not a trial"):
        read_lists(path)
    path.write_text("{")
    with pytest.raises(ConfigError, match="no list of trials"):
        read_lists(path)
