from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
import trimesh

from tr_grasp.errors import ConfigError, MeshError
from tr_grasp.objects import MeshSet, ProceduralSet, Reason, family_names, object_set, shapes


def test_the_training_set_never_gives_a_held_out_family():
    rng = np.random.default_rng(0)
    objects = object_set("procedural", "train")
    seen = {objects.sample(rng).family for _ in range(300)}
    assert seen == set(objects.names) == set(family_names("train"))


def test_wide_families_are_in_a_set_of_their_own_and_leave_held_out_scenes_alone():
    wide, rng = object_set("procedural_wide", "train"), np.random.default_rng(0)
    assert set(wide.names) == {*family_names("train"), "book", "carton", "dish", "tray"}
    assert {"book", "tray"} <= {wide.sample(rng).family for _ in range(300)}
    # Names carry a checksum of the dimensions: these objects were drawn before there were wide ones.
    held_out = [object_set("procedural", "test").sample(np.random.default_rng(seed)).name for seed in range(4)]
    assert held_out == ["tool-07e75417", "plate-550f39c9", "ring-776d16a8", "ring-ab62bdcd"]


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
    write_object(tmp_path / "test" / "second", scale=2.0)
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


def test_without_a_range_of_diagonals_objects_stay_as_large_as_they_are(tmp_path, write_object):
    write_object(tmp_path / "a", scale=1.5)
    model = object_set(str(tmp_path), "train", diagonal_range_m=None).sample(np.random.default_rng(0))
    assert model.diagonal_m == pytest.approx(1.5 * np.linalg.norm([0.055, 0.05, 0.07]), rel=1e-5)


def test_a_set_is_found_by_its_name_in_the_root_and_the_root_in_the_environment(tmp_path, write_object, monkeypatch):
    write_object(tmp_path / "sets" / "household" / "train" / "a")
    write_object(tmp_path / "sets" / "household" / "test" / "b", scale=2.0)
    assert object_set("household", "test", root=tmp_path / "sets").names == ("b",)
    monkeypatch.setenv("TR_GRASP_OBJECTS", str(tmp_path / "sets"))
    assert object_set("household", "train").names == ("a",)
    with pytest.raises(
        ConfigError, match=r"unknown objects.source 'hausehold'; did you mean 'household'\?.*procedural"
    ):
        object_set("hausehold", "train")
    monkeypatch.setenv("TR_GRASP_OBJECTS", str(tmp_path / "nowhere"))
    with pytest.raises(ConfigError, match=r"nowhere \(TR_GRASP_OBJECTS\) does not exist"):
        object_set("household", "train")


def test_objects_that_cannot_be_used_are_left_out_with_their_reasons(tmp_path, write_object, write_obj):
    for name in ("good", "huge", "lost", "open"):
        write_object(tmp_path / name, scale=1000.0 if name == "huge" else 1.0)
    (tmp_path / "lost" / "collision.obj").unlink()
    box = shapes.box((0.05, 0.05, 0.05))
    write_obj(tmp_path / "open" / "collision.obj", [trimesh.Trimesh(box.vertices, box.faces[4:], process=False)])
    with pytest.warns(
        UserWarning, match=r"3 of the 4 train objects in .* are left out: huge \(wrong units\), lost \(no co"
    ):
        objects = object_set(str(tmp_path), "train")
    assert objects.names == ("good",)
    assert {rejected.name: rejected.reason for rejected in objects.rejected} == {
        "huge": Reason.WRONG_UNITS,
        "lost": Reason.NO_COLLISION_MESH,
        "open": Reason.NOT_MANIFOLD,
    }
    assert all(str(tmp_path / rejected.name) in rejected.message for rejected in objects.rejected)
    assert object_set("procedural", "train").rejected == ()


def test_a_set_of_which_nothing_is_left_says_why(tmp_path, write_object):
    (write_object(tmp_path / "a") / "collision.obj").unlink()
    with pytest.raises(
        MeshError, match=r"holds 0 objects .*: 1 were left out. .*collision.obj is missing: physics needs"
    ):
        object_set(str(tmp_path), "train")


def test_a_range_of_diagonals_must_be_positive(tmp_path, write_object):
    write_object(tmp_path / "a")
    with pytest.raises(ConfigError, match="diagonal_range_m must be 0 < low <= high"):
        object_set(str(tmp_path), "train", diagonal_range_m=(0.2, 0.1))


def test_objects_need_neither_simulator_nor_torch():
    code = "import sys, tr_grasp.objects; print(*{name.split('.')[0] for name in sys.modules})"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert not {"sapien", "mani_skill", "torch", "torchrl", "open3d"} & set(loaded)
