from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from tr_grasp.errors import ConfigError, MeshError
from tr_grasp.objects import MeshSet, ProceduralSet, family_names, object_set


def test_the_training_set_never_gives_a_held_out_family():
    rng = np.random.default_rng(0)
    objects = object_set("procedural", "train")
    seen = {objects.sample(rng).family for _ in range(300)}
    assert seen == set(objects.names) == set(family_names("train"))


def test_a_set_can_be_narrowed_to_families_of_its_split():
    objects = ProceduralSet("test", ["can", "box"])
    assert {objects.sample(np.random.default_rng(seed)).family for seed in range(20)} == {"can", "box"}
    with pytest.raises(ConfigError, match="unknown train family 'can'"):
        ProceduralSet("train", ["can"])


@pytest.mark.parametrize("split", ["train", "test"])
def test_equal_generators_draw_equal_objects_and_nothing_else_is_random(split):
    objects = object_set("procedural", split)
    np.random.seed(0)  # noqa: NPY002 - the global generator must not matter
    first = [objects.sample(rng) for rng in [np.random.default_rng(7)] for _ in range(10)]
    again = [objects.sample(rng) for rng in [np.random.default_rng(7)] for _ in range(10)]
    for one, other in zip(first, again, strict=True):
        assert one.name == other.name
        np.testing.assert_array_equal(one.visual.vertices, other.visual.vertices)
        np.testing.assert_array_equal(one.face_colours, other.face_colours)


def test_an_unknown_source_names_the_valid_ones():
    with pytest.raises(ConfigError, match=r"unknown objects.source 'procedual'; did you mean 'procedural'\?.*folder"):
        object_set("procedual", "train")


def test_an_unknown_split_names_the_valid_ones():
    with pytest.raises(ConfigError, match=r"unknown objects.split 'tset'; did you mean 'test'\? Valid: test, train"):
        object_set("procedural", "tset")


def test_a_folder_is_a_source_and_the_split_picks_its_sub_folder(tmp_path, write_object):
    write_object(tmp_path / "train" / "first")
    write_object(tmp_path / "test" / "second")
    assert object_set(str(tmp_path), "train").names == ("first",)
    assert object_set(str(tmp_path), "test").names == ("second",)


def test_a_folder_without_split_folders_serves_either_split(tmp_path, write_object):
    for name in ("b", "a"):
        write_object(tmp_path / name)
    (tmp_path / ".cache").mkdir()
    (tmp_path / "LICENSE.txt").write_text("free")
    assert object_set(str(tmp_path), "train").names == object_set(str(tmp_path), "test").names == ("a", "b")


def test_meshes_are_scaled_to_diagonals_over_the_whole_range(tmp_path, write_object):
    write_object(tmp_path / "a", scale=0.5)
    write_object(tmp_path / "b", scale=3.0)
    objects = object_set(str(tmp_path), "train", diagonal_range_m=(0.1, 0.2))
    rng = np.random.default_rng(0)
    diagonals = np.array([objects.sample(rng).diagonal_m for _ in range(200)])
    assert 0.1 <= diagonals.min() < 0.11
    assert 0.19 < diagonals.max() <= 0.2
    assert np.mean(diagonals) == pytest.approx(0.15, abs=0.01)


def test_an_edited_object_is_read_again(tmp_path, write_object):
    folder = write_object(tmp_path / "a", colour=(255, 0, 0))
    before = MeshSet(tmp_path, "train", (0.1, 0.2)).sample(np.random.default_rng(0))
    write_object(folder, colour=(0, 0, 255))
    after = MeshSet(tmp_path, "train", (0.1, 0.2)).sample(np.random.default_rng(0))
    np.testing.assert_allclose(before.face_colours.mean(axis=0), [1, 0, 0], atol=1e-6)
    np.testing.assert_allclose(after.face_colours.mean(axis=0), [0, 0, 1], atol=1e-6)


def test_objects_that_are_in_train_and_test_are_refused(tmp_path, write_object):
    for split in ("train", "test"):
        write_object(tmp_path / split / "same")
    with pytest.raises(MeshError, match="share same; keep every object in one of them"):
        object_set(str(tmp_path), "train")


def test_a_missing_split_folder_is_named(tmp_path, write_object):
    write_object(tmp_path / "train" / "a")
    with pytest.raises(MeshError, match=r"has 'train' but no 'test' objects; add the sub-folder .*test"):
        object_set(str(tmp_path), "test")


def test_too_few_objects_are_counted(tmp_path, write_object):
    with pytest.raises(MeshError, match="holds 0 objects but at least 1 are needed"):
        object_set(str(tmp_path), "train")
    write_object(tmp_path / "a")
    with pytest.raises(MeshError, match="holds 1 objects but at least 4 are needed"):
        MeshSet(tmp_path, "train", (0.1, 0.2), at_least_n=4)


def test_a_range_of_diagonals_must_be_positive(tmp_path, write_object):
    write_object(tmp_path / "a")
    with pytest.raises(ConfigError, match="diagonal_range_m must be 0 < low <= high"):
        object_set(str(tmp_path), "train", diagonal_range_m=(0.2, 0.1))


def test_objects_need_neither_simulator_nor_torch():
    code = "import sys, tr_grasp.objects; print(*{name.split('.')[0] for name in sys.modules})"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert not {"sapien", "mani_skill", "torch", "torchrl", "open3d"} & set(loaded)
