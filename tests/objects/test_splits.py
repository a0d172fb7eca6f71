from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tr_grasp.errors import ConfigError
from tr_grasp.objects import Reason, object_set
from tr_grasp.objects.splits import hashed_split, objects_of


def names(folder, split: str, **options) -> list[str]:
    return [files.name for files in objects_of(folder, split, **options)[0]]


@pytest.fixture
def google(tmp_path):
    """A hundred empty objects in Google's layout; which split one is in needs no mesh."""
    for index in range(100):
        (tmp_path / f"Object_{index}" / "meshes").mkdir(parents=True)
    return tmp_path


def test_a_published_data_set_is_split_by_name_into_disjoint_parts_of_about_four_to_one(google):
    train, test = names(google, "train"), names(google, "test")
    assert not set(train) & set(test)
    assert len(train) + len(test) == 100
    assert 12 <= len(test) <= 28


def test_an_object_stays_in_its_split_whatever_else_is_there(google):
    before = names(google, "test")
    for index in range(0, 100, 2):
        (google / f"Object_{index}" / "meshes").rmdir()
        (google / f"Object_{index}").rmdir()
    assert names(google, "test") == [name for name in before if int(name.split("_")[1]) % 2]


@given(key=st.text(max_size=20))
def test_every_name_has_one_split(key):
    assert hashed_split(key) in ("train", "test")


def test_the_split_of_a_name_never_changes():
    assert [key for key in map(str, range(20)) if hashed_split(key) == "test"] == ["2", "3", "4", "5", "10", "11"]


def test_ycb_objects_of_one_number_stay_together(tmp_path):
    cups = [f"{number:03d}-{letter}_cups" for number in range(30) for letter in "abc"]
    (tmp_path / "info_pick_v0.json").write_text(json.dumps({name: {} for name in cups}))
    for split in ("train", "test"):
        numbers = [name[:3] for name in names(tmp_path, split)]
        assert all(numbers.count(number) == 3 for number in numbers)


def test_a_split_file_decides_and_leaves_out_what_it_does_not_name(tmp_path, write_object):
    for index, name in enumerate("abcd"):
        write_object(tmp_path / name, scale=1 + index / 10)
    (tmp_path / "split.json").write_text('{"train": ["b", "a"], "test": ["d"]}')
    assert names(tmp_path, "train") == ["a", "b"]
    assert names(tmp_path, "test") == ["d"]


@pytest.mark.parametrize("content", ["", "[]", '{"train": ["a"]}', '{"train": 1, "test": []}'])
def test_a_split_file_that_is_none_is_named(tmp_path, write_object, content):
    write_object(tmp_path / "a")
    (tmp_path / "split.json").write_text(content)
    with pytest.raises(ConfigError, match=r'split.json must be \{"train": \[names\], "test": \[names\]\}'):
        objects_of(tmp_path, "train")


def test_a_split_file_that_names_unknown_objects_is_refused(tmp_path, write_object):
    write_object(tmp_path / "a")
    (tmp_path / "split.json").write_text('{"train": ["a", "nail"], "test": ["bolt"]}')
    with pytest.raises(ConfigError, match=r"split.json names objects that .* does not hold: bolt, nail"):
        objects_of(tmp_path, "train")


def test_one_name_in_both_splits_is_refused(tmp_path, write_object):
    write_object(tmp_path / "train" / "same")
    write_object(tmp_path / "test" / "same", scale=2.0)
    for split in ("train", "test"):
        with pytest.raises(ConfigError, match="share same; keep every object in one of them"):
            object_set(str(tmp_path), split)


def test_one_name_in_both_lists_of_a_split_file_is_refused(tmp_path, write_object):
    write_object(tmp_path / "same")
    (tmp_path / "split.json").write_text('{"train": ["same"], "test": ["same"]}')
    with pytest.raises(ConfigError, match="share same; keep every object in one of them"):
        objects_of(tmp_path, "train")


def test_one_object_under_two_names_is_refused_and_both_are_named(tmp_path, write_object):
    write_object(tmp_path / "train" / "first")
    write_object(tmp_path / "test" / "second")
    write_object(tmp_path / "test" / "blue", colour=(0, 0, 255))
    with pytest.raises(
        ConfigError, match=r"share second \(equal to first\); keep .* or set objects.overlap to leave_out"
    ):
        object_set(str(tmp_path), "train")


def test_objects_of_both_splits_can_be_left_out_of_the_test(tmp_path, write_object):
    write_object(tmp_path / "train" / "first")
    write_object(tmp_path / "test" / "second")
    write_object(tmp_path / "test" / "third", scale=2.0)
    with pytest.warns(
        UserWarning, match=r"1 of the 2 test objects in .* are left out: second \(also a training object"
    ):
        test = object_set(str(tmp_path), "test", overlap="leave_out")
    assert test.names == ("third",)
    assert [(rejected.name, rejected.reason) for rejected in test.rejected] == [("second", Reason.IN_TRAINING)]
    train = object_set(str(tmp_path), "train", overlap="leave_out")
    assert (train.names, train.rejected) == (("first",), ())
    assert train.sample(np.random.default_rng(0)).name == "first"
