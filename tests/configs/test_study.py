from __future__ import annotations

import pytest

from tr_grasp.configs.io import load_train_cfg
from tr_grasp.configs.study import load_study, study_names
from tr_grasp.errors import ConfigError


def test_the_package_offers_the_eight_comparisons_of_the_thesis() -> None:
    assert [name.partition("_")[0] for name in study_names()] == [f"c{i}" for i in range(1, 9)]


@pytest.mark.parametrize("name", study_names())
def test_every_run_of_a_study_is_another_one(name: str) -> None:
    study = load_study(name)
    runs = list(study.runs.values())
    assert len(runs) >= 2
    assert study.question.endswith((".", "?"))
    assert all(runs.index(run) == index for index, run in enumerate(runs))


def test_runs_are_presets_with_changes() -> None:
    runs = load_study("c1_colour").runs
    assert runs["with colour"] == load_train_cfg("thesis")
    assert not runs["without colour, all else equal"].env.observation.colour
    assert runs["without colour, all else equal"].env.action == runs["with colour"].env.action


def test_a_study_of_ones_own_may_extend_files_beside_it(tmp_path) -> None:
    (tmp_path / "mine.yaml").write_text("extends: smoke\nseed: 4\n")
    (tmp_path / "study.yaml").write_text("question: Why?\nruns:\n  a: {extends: mine.yaml}\n  b: {extends: smoke}\n")
    study = load_study(tmp_path / "study.yaml")
    assert (study.name, study.question, study.runs["a"].seed, study.runs["b"].seed) == ("study", "Why?", 4, 0)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("question: Why?\n", "x.yaml: a study has question and runs, got question"),
        ("question: Why?\nruns: {a: {}}\n", "x.yaml: runs: give at least two"),
        (
            "question: Why?\nruns: {a: smoke, b: {}}\n",
            "x.yaml: runs: a: expected settings as 'name: value', got 'smoke'",
        ),
        (
            "question: Why?\nruns: {a: {extends: grap}, b: {}}\n",
            "runs: a: extends: unknown preset 'grap'; did you mean",
        ),
        ("question: Why?\nruns: {a: {sed: 1}, b: {}}\n", "did you mean seed?"),
    ],
)
def test_a_wrong_study_is_refused_in_one_sentence(tmp_path, text: str, sentence: str) -> None:
    (tmp_path / "x.yaml").write_text(text)
    with pytest.raises(ConfigError) as error:
        load_study(tmp_path / "x.yaml")
    assert sentence in str(error.value)


def test_an_unknown_study_lists_the_known_ones() -> None:
    with pytest.raises(ConfigError, match="unknown study 'c1_color'; did you mean 'c1_colour'"):
        load_study("c1_color")
