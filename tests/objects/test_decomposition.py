from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
import trimesh

from tr_grasp.errors import MissingSystemLibraryError, StorageError
from tr_grasp.files import cache_folder
from tr_grasp.objects import Reason, shapes
from tr_grasp.objects.closing import closed_volume
from tr_grasp.objects.decomposition import convex_parts
from tr_grasp.objects.model import distance_outside
from tr_grasp.objects.rejection import RejectedMesh


@pytest.fixture
def elbow() -> trimesh.Trimesh:
    """Two arms of 40 x 20 x 20 mm and the corner between them, as one closed surface."""
    outline = 0.02 * np.array([(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)])
    bottom, top = (np.column_stack([outline, np.full(6, z)]) for z in (0.0, 0.02))
    cap = np.array([(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)])
    sides = [face for i in range(6) for j in [(i + 1) % 6] for face in ((i, j, j + 6), (i, j + 6, i + 6))]
    return trimesh.Trimesh(np.vstack([bottom, top]), np.vstack([cap[:, ::-1], cap + 6, sides]), process=False)


def without_faces(mesh: trimesh.Trimesh, chosen) -> trimesh.Trimesh:
    return trimesh.Trimesh(mesh.vertices, mesh.faces[~chosen(mesh.triangles_center)], process=False)


def test_an_elbow_becomes_convex_parts_that_fill_it(elbow, tmp_path):
    pytest.importorskip("coacd")
    parts = convex_parts(elbow, "elbow", tmp_path)
    assert len(parts) > 1
    assert all(part.is_convex for part in parts)
    assert sum(part.volume for part in parts) == pytest.approx(5 * 0.02**3, rel=0.05)
    # The notch stays free, the arms do not.
    distance = np.min([distance_outside(part, np.array([(0.04, 0.04, 0.01), (0.05, 0.01, 0.01)])) for part in parts], 0)
    assert distance[0] > 0.01
    assert distance[1] < 0


def test_the_second_time_parts_come_from_the_cache_bit_by_bit_and_a_changed_mesh_does_not(elbow, tmp_path, monkeypatch):
    coacd = pytest.importorskip("coacd")
    first = convex_parts(elbow, "elbow", tmp_path / "new" / "cache")
    monkeypatch.setattr(coacd, "run_coacd", lambda *_, **__: pytest.fail("it was decomposed again"))
    again = convex_parts(elbow, "another name", tmp_path / "new" / "cache")
    for part, same in zip(first, again, strict=True):
        np.testing.assert_array_equal(part.vertices, same.vertices)
        np.testing.assert_array_equal(part.faces, same.faces)
    assert [path.suffix for path in (tmp_path / "new" / "cache").iterdir()] == [".obj"]
    with pytest.raises(pytest.fail.Exception, match="decomposed again"):
        convex_parts(elbow.apply_scale(2.0), "elbow", tmp_path / "new" / "cache")


def test_without_coacd_a_sentence_says_what_to_install(elbow, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "coacd", None)
    with pytest.raises(
        MissingSystemLibraryError, match=r"elbow has no convex parts and CoACD.*pip install 'tr-grasp\[me"
    ):
        convex_parts(elbow, "elbow", tmp_path)


def test_open3d_still_loads_in_a_process_that_decomposed_a_mesh_first(tmp_path):
    pytest.importorskip("coacd")
    pytest.importorskip("open3d")
    code = (
        "from pathlib import Path\n"
        "from tr_grasp.objects import shapes\n"
        "from tr_grasp.objects.decomposition import convex_parts\n"
        f"convex_parts(shapes.box((0.1, 0.1, 0.1)), 'box', Path({str(tmp_path)!r}))\n"
        "import open3d\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)


def test_a_cache_that_cannot_be_made_is_named(elbow, tmp_path):
    pytest.importorskip("coacd")
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(StorageError, match=r"could not make '.*file/cache': .*; set TR_GRASP_CACHE to a folder"):
        convex_parts(elbow, "elbow", tmp_path / "file" / "cache")


def test_the_cache_is_where_the_user_says(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    monkeypatch.delenv("TR_GRASP_CACHE", raising=False)
    assert cache_folder() == tmp_path / "xdg" / "tr_grasp"
    monkeypatch.setenv("TR_GRASP_CACHE", str(tmp_path / "mine"))
    assert cache_folder() == tmp_path / "mine"


def test_a_box_without_its_bottom_gets_one():
    box = shapes.box((0.1, 0.1, 0.1))
    closed = closed_volume(without_faces(box, lambda centres: centres[:, 2] < -0.049), "box")
    assert closed.is_volume
    assert closed.volume == pytest.approx(0.001)


def test_two_holes_get_a_lid_each():
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.05)
    closed = closed_volume(without_faces(ball, lambda centres: np.abs(centres[:, 2]) > 0.045), "ball")
    assert closed.is_volume
    assert len(closed.vertices) == len(np.unique(without_faces(ball, lambda c: np.abs(c[:, 2]) > 0.045).faces)) + 2


def test_a_closed_mesh_of_loose_triangles_is_joined_and_otherwise_left_alone():
    box = shapes.box((0.1, 0.2, 0.3))
    loose = trimesh.Trimesh(box.triangles.reshape(-1, 3), np.arange(36).reshape(-1, 3), process=False)
    closed = closed_volume(loose, "box")
    assert (len(closed.vertices), len(closed.faces)) == (8, 12)
    assert closed.volume == pytest.approx(box.volume)


def test_half_a_hollow_ball_is_an_opening_and_no_hole():
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.05)
    with pytest.raises(RejectedMesh, match=r"holes are 3\d% of the surface of bowl, more than 20%") as caught:
        closed_volume(without_faces(ball, lambda centres: centres[:, 2] > 0), "bowl")
    assert caught.value.reason is Reason.NOT_MANIFOLD


def test_edges_of_three_faces_enclose_nothing():
    box = shapes.box((0.1, 0.1, 0.1))
    fin = trimesh.Trimesh(
        np.vstack([box.vertices, [[0.1, 0.0, 0.2]]]), np.vstack([box.faces, [[0, 1, 8], [1, 0, 8]]]), process=False
    )
    with pytest.raises(RejectedMesh, match="finned encloses no volume: some edges do not join exactly two faces"):
        closed_volume(fin, "finned")


def test_a_sheet_has_no_volume():
    sheet = trimesh.Trimesh([(0, 0, 0), (0.1, 0, 0), (0.1, 0.1, 0), (0, 0.1, 0)], [(0, 1, 2), (0, 2, 3)], process=False)
    with pytest.raises(RejectedMesh, match="sheet is flat: it has no volume; give it thickness") as caught:
        closed_volume(sheet, "sheet")
    assert caught.value.reason is Reason.NO_VOLUME
