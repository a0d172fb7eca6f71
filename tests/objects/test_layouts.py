"""The published layouts, as small data sets that the tests write."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from tr_grasp.errors import MeshError
from tr_grasp.objects import Reason, object_set, shapes
from tr_grasp.objects.collision_parts import load_parts
from tr_grasp.objects.layouts import objects_in, sdf_scale
from tr_grasp.objects.meshes import load_files, load_object
from tr_grasp.objects.rejection import RejectedMesh
from tr_grasp.objects.visual_mesh import VISUAL_FACES_MAX, load_visual

BOX_M = (0.04, 0.06, 0.08)


def textured_obj(solid: trimesh.Trimesh, material_file: str) -> str:
    """A mesh whose left half (x < 0) shows the left half of the texture."""
    lines = [f"mtllib {material_file}", "usemtl material_0"]
    lines += [f"v {x} {y} {z}" for x, y, z in solid.vertices]
    lines += [f"vt {0.25 if x < 0 else 0.75} 0.5" for x, _, _ in solid.vertices]
    lines += ["f " + " ".join(f"{i}/{i}" for i in face + 1) for face in solid.faces]
    return "\n".join(lines) + "\n"


def write_texture(path: Path) -> None:
    """Red on the left and blue on the right."""
    path.parent.mkdir(parents=True, exist_ok=True)
    pixels = np.zeros((8, 8, 3), np.uint8)
    pixels[:, :4, 0] = pixels[:, 4:, 2] = 255
    Image.fromarray(pixels).save(path)


def write_maniskill(root: Path, name: str, *, entry: dict | None = None, collision: str = "collision.ply") -> Path:
    """An object of ManiSkill's ``mani_skill2_ycb``, with two touching hulls in one collision file."""
    folder = root / "models" / name
    folder.mkdir(parents=True)
    box = shapes.box(BOX_M)
    (folder / "textured.obj").write_text(textured_obj(box, "material_0.mtl"))
    (folder / "material_0.mtl").write_text("newmtl material_0\nKd 1 1 1\nmap_Kd texture_map.png\n")
    write_texture(folder / "texture_map.png")
    x, y, z = BOX_M
    halves = [shapes.box((x, y, z / 2), (0.0, 0.0, side * z / 4)) for side in (-1, 1)]
    trimesh.util.concatenate(halves).export(folder / collision)
    catalogue = root / "info_pick_v0.json"
    entries = json.loads(catalogue.read_text()) if catalogue.is_file() else {}
    entries[name] = {"bbox": {"min": [-1, -1, -1], "max": [1, 1, 1]}, "scales": [1.0], "density": 500} | (entry or {})
    catalogue.write_text(json.dumps(entries))
    return folder


def write_google(folder: Path, solid: trimesh.Trimesh, *, scale: str = "1 1 1") -> Path:
    """An object as Google Scanned Objects are published: the texture is not where the material says."""
    (folder / "meshes").mkdir(parents=True)
    (folder / "meshes" / "model.obj").write_text(textured_obj(solid, "model.mtl"))
    (folder / "meshes" / "model.mtl").write_text("newmtl material_0\nKd 0.8 0.8 0.8\nmap_Kd texture.png\n")
    write_texture(folder / "materials" / "textures" / "texture.png")
    (folder / "thumbnails").mkdir()
    (folder / "model.config").write_text("<?xml version='1.0'?><model><name>a</name></model>")
    (folder / "model.sdf").write_text(
        "<?xml version='1.0'?><sdf version='1.6'><model name='a'><link name='link_0'><visual name='visual'><geometry>"
        f"<mesh><scale>{scale}</scale><uri>meshes/model.obj</uri></mesh>"
        "</geometry></visual></link></model></sdf>"
    )
    return folder


@pytest.fixture
def cache(tmp_path, monkeypatch):
    pytest.importorskip("coacd")
    monkeypatch.setenv("TR_GRASP_CACHE", str(tmp_path / "cache"))


def assert_red_and_blue(model) -> None:
    middle = model.visual.triangles_center[:, 0]
    np.testing.assert_allclose(model.face_colours[middle < -0.019], [[1, 0, 0]] * (middle < -0.019).sum(), atol=1e-6)
    np.testing.assert_allclose(model.face_colours[middle > 0.019], [[0, 0, 1]] * (middle > 0.019).sum(), atol=1e-6)


def test_maniskills_ycb_folder_is_a_set_with_scales_textures_and_one_part_for_each_piece(tmp_path):
    write_maniskill(tmp_path, "025_mug", entry={"scales": [0.5, 1.0]})
    write_maniskill(tmp_path, "011_banana", collision="collision.obj")
    banana, mug = objects_in(tmp_path)
    assert (banana.name, mug.name) == ("011_banana", "025_mug")
    model = load_files(mug)
    np.testing.assert_allclose(model.extents_m, np.array(BOX_M) / 2, atol=1e-6)
    assert len(model.parts) == 2
    assert load_files(banana).extents_m == pytest.approx(BOX_M)
    assert_red_and_blue(load_files(banana))


def test_an_object_that_the_catalogue_names_and_the_folder_lacks_is_left_out(tmp_path):
    write_maniskill(tmp_path, "006_mustard_bottle")
    folder = write_maniskill(tmp_path, "025_mug")
    (folder / "collision.ply").unlink()
    with pytest.warns(UserWarning, match=r"1 of the 2 train objects .*: 025_mug \(no collision mesh\)"):
        objects = object_set(str(tmp_path), "train")
    assert objects.names == ("006_mustard_bottle",)


@pytest.mark.parametrize("content", ["", "[]", '{"a": 1}', '{"a": {"scales": []}}', '{"a": {"scales": ["big"]}}'])
def test_a_catalogue_that_is_no_catalogue_is_named(tmp_path, content):
    (tmp_path / "info_pick_v0.json").write_text(content)
    with pytest.raises(MeshError, match=r"cannot read .*info_pick_v0.json: .*; download the data set again"):
        objects_in(tmp_path)


def test_pieces_of_a_soup_of_triangles_are_found_by_their_places(tmp_path):
    boxes = [shapes.box((0.1, 0.1, 0.1)), shapes.box((0.1, 0.1, 0.1), (0.2, 0.0, 0.0))]
    triangles = np.concatenate([box.triangles for box in boxes]).reshape(-1, 3)
    soup = trimesh.Trimesh(triangles, np.arange(len(triangles)).reshape(-1, 3), process=False)
    soup.export(tmp_path / "collision.ply")
    assert [part.volume for part in load_parts(tmp_path / "collision.ply")] == pytest.approx([0.001, 0.001])


def test_a_google_scanned_object_is_split_into_parts_scaled_and_coloured(tmp_path, cache):
    model = load_object(write_google(tmp_path / "Mug", shapes.box(BOX_M), scale="1 1 2"))
    np.testing.assert_allclose(model.extents_m, [0.04, 0.06, 0.16], atol=1e-5)
    assert (model.name, len(model.parts)) == ("Mug", 1)
    assert_red_and_blue(model)


def test_a_google_scan_in_millimetres_is_made_metric_by_its_description_or_refused_without(tmp_path, cache):
    box = shapes.box((40.0, 60.0, 80.0))
    model = load_object(write_google(tmp_path / "a", box, scale="0.001 0.001 0.001"))
    np.testing.assert_allclose(model.extents_m, BOX_M, atol=1e-5)
    (tmp_path / "a" / "model.sdf").unlink()
    with pytest.raises(RejectedMesh, match=r"model.obj is 108 m across, outside 0.001 to 10 m; convert it to metres"):
        load_object(tmp_path / "a")


@pytest.mark.parametrize("scale", ["0 1 1", "-1 1 1", "1 1", "big", "nan 1 1"])
def test_a_scale_that_is_none_is_refused(tmp_path, scale):
    folder = write_google(tmp_path / "a", shapes.box(BOX_M), scale=scale)
    with pytest.raises(RejectedMesh, match=r"cannot read .*model.sdf: .*; correct it or remove it") as caught:
        sdf_scale(folder / "model.sdf")
    assert caught.value.reason is Reason.UNREADABLE


def test_a_description_that_was_cut_short_is_refused_and_one_without_a_scale_means_metres(tmp_path):
    (tmp_path / "a.sdf").write_text("<sdf><model>")
    with pytest.raises(RejectedMesh, match=r"cannot read .*a.sdf"):
        sdf_scale(tmp_path / "a.sdf")
    (tmp_path / "a.sdf").write_text("<sdf><mesh><uri>a</uri></mesh></sdf>")
    assert sdf_scale(tmp_path / "a.sdf") == (1.0, 1.0, 1.0)


def test_a_google_scan_without_its_mesh_or_with_a_broken_texture_is_named(tmp_path):
    folder = write_google(tmp_path / "a", shapes.box(BOX_M))
    (folder / "materials" / "textures" / "texture.png").write_bytes(b"no picture")
    with pytest.raises(RejectedMesh, match=r"cannot read .*texture.png"):
        load_object(folder)
    (folder / "meshes" / "model.obj").unlink()
    with pytest.raises(RejectedMesh, match=r"model.obj is missing: without it cameras cannot see the object"):
        load_object(folder)


def test_a_picture_on_few_triangles_can_be_made_out(tmp_path):
    """A plate of 12 triangles whose top shows a picture with a red and a blue half."""
    solid = shapes.box((0.08, 0.08, 0.02))
    lines = ["mtllib model.mtl", "usemtl material_0"]
    lines += [f"v {x} {y} {z}" for x, y, z in solid.vertices]
    lines += [f"vt {x / 0.08 + 0.5} {y / 0.08 + 0.5}" for x, y, _ in solid.vertices]
    lines += ["f " + " ".join(f"{i}/{i}" for i in face + 1) for face in solid.faces]
    (tmp_path / "model.obj").write_text("\n".join(lines) + "\n")
    write_texture(tmp_path / "texture.png")
    mesh, colours = load_visual(tmp_path / "model.obj", texture=tmp_path / "texture.png")
    assert len(solid.faces) < 500 < len(mesh.faces) <= VISUAL_FACES_MAX
    np.testing.assert_allclose(np.sort(mesh.bounds, axis=0), np.sort(solid.bounds, axis=0), atol=1e-6)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(solid.volume)
    middle = mesh.triangles_center[:, 0]
    assert (colours[middle < -0.011] == [1, 0, 0]).all()
    assert (colours[middle > 0.011] == [0, 0, 1]).all()
