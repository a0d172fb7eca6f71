from __future__ import annotations

import json

import numpy as np
import pytest
from safetensors.numpy import save_file

from tests.grasps.things import brick, grasps_at
from tr_grasp.errors import GraspError
from tr_grasp.evaluation.statistics import Counts, wilson_interval
from tr_grasp.grasps import (
    GraspSet,
    contact_sheet,
    robot_model,
    shape_key,
    shipped_grasp_set,
    shipped_objects,
    wilson_lower,
)
from tr_grasp.objects import conveyor_names, conveyor_object


def small_set(model=None) -> GraspSet:
    model = model or brick()
    grasps = grasps_at([[0.0, 0.02, 0.02], [0.0, 0.02, 0.03]])
    return GraspSet(
        model.name, "robotiq_2f85", grasps, np.array([50, 45]), np.array([50, 50]), shape_key(model, "robotiq_2f85"),
        {"seed": 3}, {"tries_n": 100}, model.bounds_m,
    )  # fmt: skip


def test_a_set_is_read_as_it_was_written(tmp_path):
    made = small_set()
    read = GraspSet.load(made.save(tmp_path / "a.grasps.safetensors"))
    np.testing.assert_allclose(read.grasps.poses(), made.grasps.poses(), atol=1e-6)
    np.testing.assert_array_equal(read.successes, made.successes)
    assert (read.object_name, read.gripper, read.settings, read.statistics) == (
        "brick", "robotiq_2f85", {"seed": 3}, {"tries_n": 100},
    )  # fmt: skip


def test_every_damaged_byte_is_noticed(tmp_path):
    path = small_set().save(tmp_path / "a")
    content = path.read_bytes()
    for place in range(0, len(content), 97):
        path.write_bytes(content[:place] + bytes([content[place] ^ 0x41]) + content[place + 1 :])
        with pytest.raises(GraspError):
            GraspSet.load(path)
    path.write_bytes(content[: len(content) // 2])
    with pytest.raises(GraspError, match="damaged"):
        GraspSet.load(path)


def test_files_that_are_no_grasp_set_are_refused(tmp_path):
    with pytest.raises(GraspError, match="there is no grasp set"):
        GraspSet.load(tmp_path / "nothing")
    (tmp_path / "text").write_text(json.dumps({"grasps": []}))
    with pytest.raises(GraspError, match="damaged or no grasp set"):
        GraspSet.load(tmp_path / "text")
    save_file({"x": np.zeros(3)}, tmp_path / "other")
    with pytest.raises(GraspError, match="not a grasp set of this version"):
        GraspSet.load(tmp_path / "other")


def test_an_empty_set_is_refused(tmp_path):
    path = small_set().subset(np.zeros(0, int)).save(tmp_path / "a")
    with pytest.raises(GraspError, match="holds no grasp"):
        GraspSet.load(path)


def test_a_set_fits_its_own_shape_and_gripper_alone():
    made = small_set()
    assert made.require_for(brick(), "robotiq_2f85") is made
    for other in (brick((0.0401, 0.09, 0.12)), brick().scaled(1.02)):
        with pytest.raises(GraspError, match="another shape, size or gripper"):
            made.require_for(other)
    with pytest.raises(GraspError, match="for gripper 'robotiq_2f85', not 'rg2'"):
        made.require_for(brick(), "rg2")


def test_those_that_held_often_enough_are_a_set_of_their_own():
    made = small_set()
    assert [len(made.held_at_least(share)) for share in (0.0, 0.9, 0.91)] == [2, 2, 1]
    with pytest.raises(GraspError, match="held in 91 % of its tries, the best in 90 %"):
        made.subset(np.array([1])).held_at_least(0.91)


@pytest.mark.parametrize(("held", "n"), [(0, 1), (1, 1), (25, 50), (49, 50), (50, 50)])
def test_robustness_is_the_lower_end_of_wilsons_interval(held, n):
    np.testing.assert_allclose(wilson_lower(np.array([held]), np.array([n])), wilson_interval(Counts(held, n)).low)


def test_nothing_is_known_without_tries():
    assert wilson_lower(np.array([0]), np.array([0])).tolist() == [0.0]


def test_a_contact_sheet_is_a_picture_that_shows_the_hand(tmp_path):
    import imageio.v3 as imageio

    made = small_set()
    empty = contact_sheet(made, brick(), tmp_path / "a.png", tiles_n=2)
    assert imageio.imread(empty).std() > 10
    with pytest.raises(GraspError, match=r"a \.png file"):
        contact_sheet(made, brick(), tmp_path / "a.jpg")
    with pytest.raises(GraspError, match="another shape"):
        contact_sheet(made, brick((0.05, 0.09, 0.12)), tmp_path / "b.png")


def test_the_grasps_of_task_two_come_with_the_package():
    assert shipped_objects() == tuple(sorted(conveyor_names()))
    for name in conveyor_names():
        shipped = shipped_grasp_set(name).require_for(conveyor_object(name).model, "robotiq_2f85")
        assert len(shipped) >= 100
        assert (np.diff(shipped.robustness) <= 1e-12).all()
        assert (shipped.tries == 50).all()
    with pytest.raises(GraspError, match="006_mustard_bottle"):
        shipped_grasp_set("mustard_bottle")


def test_the_key_forgets_the_digits_that_another_order_of_sums_would_change():
    text = '<origin xyz="-0 0.1000000001 -1e-17" rpy="1.5707963 2 0"/>'
    assert robot_model._NUMBER.sub(robot_model._rounded, text) == (
        '<origin xyz="0.00000 0.10000 0.00000" rpy="1.57080 2.00000 0.00000"/>'
    )
