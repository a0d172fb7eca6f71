from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tr_grasp.errors import ConfigError, StorageError
from tr_grasp.evaluation.records import EpisodeLog, EpisodeRecord, by_suite, in_order, read_episodes, write_episodes

BOX = EpisodeRecord(
    suite="single",
    episode=0,
    seed=20_000,
    success=True,
    outcome="lifted",
    steps=14,
    reward=399.93,
    objects_n=1,
    objects=("box_3",),
    families=("box",),
    reached=True,
    touched=True,
    grasped=True,
    lifted=True,
    wall_s=0.4,
)


def written(folder: Path, episodes: list[EpisodeRecord]) -> Path:
    path = folder / "episodes.csv"
    write_episodes(path, episodes)
    return path


words = st.text("abc, '\"é\n", min_size=1, max_size=8).map(lambda text: f"x{text}x")
records = st.builds(
    EpisodeRecord,
    suite=words,
    outcome=words,
    objects=st.lists(words, max_size=3).map(tuple),
    families=st.lists(words, max_size=3).map(tuple),
    reward=st.floats(-1e3, 1e3),
    wall_s=st.floats(0, 1e3),
)


@settings(max_examples=30)
@given(st.lists(records, min_size=1, max_size=5))
def test_what_is_written_is_read_back(tmp_path_factory: pytest.TempPathFactory, episodes: list[EpisodeRecord]) -> None:
    path = tmp_path_factory.mktemp("records") / "episodes.csv"
    write_episodes(path, episodes)
    assert read_episodes(path) == in_order(episodes)


def test_one_row_by_hand(tmp_path: Path) -> None:
    path = written(tmp_path, [replace(BOX, objects=("box_3", "mug, blue"))])
    assert path.read_text().splitlines() == [
        "suite,episode,seed,success,outcome,steps,reward,objects_n,objects,families,"
        "reached,touched,grasped,lifted,wall_s",
        'single,0,20000,True,lifted,14,399.93,1,"box_3 + mug, blue",box,True,True,True,True,0.4',
    ]


def test_records_differ_by_anything_but_the_wall_time() -> None:
    assert replace(BOX, wall_s=9.0) == BOX
    assert replace(BOX, steps=15) != BOX


def test_records_are_sorted_within_their_suites() -> None:
    late = replace(BOX, episode=2)
    pile = replace(BOX, suite="pile")
    assert in_order([late, pile, BOX]) == [BOX, late, pile]
    assert list(by_suite([late, pile, BOX])) == ["single", "pile"]


def test_the_log_holds_every_finished_episode_while_it_is_open(tmp_path: Path) -> None:
    path = tmp_path / "new" / "episodes.csv"
    with EpisodeLog(path) as log:
        log.append(BOX)
        assert read_episodes(path) == [BOX]
        log.append(replace(BOX, episode=1))
        assert len(read_episodes(path.parent)) == 2


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ("", "holds no episodes"),
        ("suite,episode\nsingle,0\n", "lacks the column(s) seed, success"),
        (None, "does not exist"),
    ],
)
def test_a_file_that_is_no_table_of_episodes_is_refused(tmp_path: Path, content: str | None, sentence: str) -> None:
    path = tmp_path / "episodes.csv"
    if content is not None:
        path.write_text(content)
    with pytest.raises(ConfigError, match=r"episodes\.csv") as error:
        read_episodes(path)
    assert sentence in str(error.value)


def test_a_wrong_value_is_named_with_its_line(tmp_path: Path) -> None:
    path = written(tmp_path, [BOX])
    path.write_text(path.read_text().replace(",14,", ",many,"))
    with pytest.raises(ConfigError, match=r"line 2: steps must be a whole number, got 'many'"):
        read_episodes(path)


def test_a_row_that_was_cut_short_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path, [BOX])
    path.write_text(path.read_text()[:-20])
    with pytest.raises(ConfigError, match="line 2: "):
        read_episodes(path)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "episodes.csv").symlink_to("/dev/full")
    with pytest.raises(StorageError, match="No space left"), EpisodeLog(tmp_path / "episodes.csv") as log:
        log.append(BOX)
