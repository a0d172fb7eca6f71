from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tests.objects.conftest import obj_text
from tr_grasp.errors import ConfigError, MeshError
from tr_grasp.objects import conveyor_names, conveyor_object, conveyor_objects, shapes, single_object

EXTENTS_M = {
    "021_bleach_cleanser": (0.1024, 0.0677, 0.2506),
    "006_mustard_bottle": (0.0972, 0.0666, 0.1913),
    "010_potted_meat_can": (0.1021, 0.0601, 0.0835),
    "004_sugar_box": (0.0495, 0.0942, 0.1760),
    "035_power_drill": (0.1842, 0.0573, 0.1875),
}
MASSES_KG = {"021": 1.131, "006": 0.603, "010": 0.370, "004": 0.514, "035": 0.895}


@pytest.mark.parametrize("name", conveyor_names())
def test_a_stand_in_has_the_size_and_mass_of_the_real_object(name):
    thing = conveyor_object(name)
    np.testing.assert_allclose(thing.model.extents_m, EXTENTS_M[name], atol=2e-4)
    assert thing.mass_kg == MASSES_KG[name[:3]]


@pytest.mark.parametrize("thing", conveyor_objects(), ids=lambda thing: thing.name)
def test_a_stand_in_is_made_of_convex_solids_and_stands(thing):
    for part in thing.model.parts:
        assert part.is_volume
        assert part.is_convex
        assert len(part.vertices) <= 64
    lowest = np.concatenate([part.vertices for part in thing.model.parts])
    lowest = lowest[lowest[:, 2] < thing.model.bounds_m[0, 2] + 1e-6]
    # The centre of mass, which is the origin, is a centimetre or more inside the base.
    assert (lowest[:, :2].min(axis=0) < -0.01).all()
    assert (lowest[:, :2].max(axis=0) > 0.01).all()


def test_an_object_from_files_stands_as_the_stand_in_does(tmp_path):
    lying_drill = [shapes.box((0.18, 0.03, 0.05), (0.0, 0.08, 0.0)), shapes.box((0.05, 0.16, 0.05), (0.0, -0.015, 0.0))]
    folder = tmp_path / "035_power_drill"
    folder.mkdir()
    for file in ("collision.obj", "visual.obj"):
        (folder / file).write_text(obj_text(lying_drill))
    (folder / "meta.json").write_text(json.dumps({}))
    model = conveyor_object("035_power_drill", tmp_path).model
    np.testing.assert_allclose(model.extents_m, (0.18, 0.05, 0.19), atol=1e-6)
    widest = max(model.parts, key=lambda part: np.ptp(part.vertices[:, 0]))
    assert widest.vertices[:, 2].min() > 0  # the motor is on top


def test_what_is_missing_is_named(tmp_path):
    with pytest.raises(ConfigError, match=r"did you mean '006_mustard_bottle'\?"):
        conveyor_object("006_mustard_botle")
    with pytest.raises(ConfigError, match="does not exist"):
        conveyor_object("004_sugar_box", tmp_path / "nothing")
    with pytest.raises(ConfigError, match="has no '004_sugar_box'"):
        conveyor_object("004_sugar_box", tmp_path)


def test_a_single_object_is_known_by_name_folder_or_file(tmp_path, write_object):
    assert single_object("004_sugar_box").mass_kg == 0.514
    folder = write_object(tmp_path / "ell")
    thing = single_object(str(folder))
    np.testing.assert_allclose(thing.mass_kg, 600.0 * thing.model.volume_m3)
    twice = single_object(str(folder), scale=2.0)
    np.testing.assert_allclose(twice.model.extents_m, 2 * thing.model.extents_m)
    np.testing.assert_allclose(twice.mass_kg, 8 * thing.mass_kg)
    assert single_object(str(folder), mass_kg=0.2).mass_kg == 0.2


@pytest.mark.parametrize("scale", [0.0, -1.0, float("nan"), float("inf")])
def test_a_scale_without_meaning_is_refused(scale):
    with pytest.raises(ConfigError, match="scale must be positive"):
        single_object("004_sugar_box", scale=scale)


def test_open_foreign_and_missing_meshes_are_refused(tmp_path: Path):
    box = shapes.box((0.05, 0.05, 0.05))
    box.update_faces(np.arange(len(box.faces)) < 8)
    (tmp_path / "open.obj").write_text(obj_text([box]))
    with pytest.raises(MeshError, match="holes are"):
        single_object(str(tmp_path / "open.obj"))
    (tmp_path / "text.txt").write_text("no mesh")
    with pytest.raises(MeshError, match="is no mesh file"):
        single_object(str(tmp_path / "text.txt"))
    with pytest.raises(ConfigError, match="may also be the path of a mesh file"):
        single_object(str(tmp_path / "nothing.obj"))
