from __future__ import annotations

import re
import sys

import numpy as np
import pytest
import trimesh

from tr_grasp.errors import MeshError, MissingSystemLibraryError
from tr_grasp.objects import shapes
from tr_grasp.objects.collision_parts import load_parts
from tr_grasp.objects.mesh_checks import require_few_faces
from tr_grasp.objects.meshes import load_object
from tr_grasp.objects.obj_groups import groups_text, read_groups
from tr_grasp.objects.rejection import Reason, RejectedMesh
from tr_grasp.objects.visual_mesh import GREY, VISUAL_FACES_MAX, load_visual


def without_faces(solid: trimesh.Trimesh, count: int) -> trimesh.Trimesh:
    return trimesh.Trimesh(solid.vertices, solid.faces[count:], process=False)


def inside_out(solid: trimesh.Trimesh) -> trimesh.Trimesh:
    return trimesh.Trimesh(solid.vertices, solid.faces[:, ::-1], process=False)


def test_a_good_folder_becomes_a_centred_coloured_model(tmp_path, write_object):
    model = load_object(write_object(tmp_path / "elbow", colour=(255, 128, 0)))
    assert (model.name, model.family, len(model.parts)) == ("elbow", "elbow", 2)
    assert model.volume_m3 == pytest.approx(2 * 0.05 * 0.05 * 0.02, rel=1e-5)
    centre = np.average([part.center_mass for part in model.parts], axis=0, weights=[p.volume for p in model.parts])
    np.testing.assert_allclose(centre, 0, atol=1e-8)
    np.testing.assert_allclose(model.visual.bounds, model.bounds_m, atol=1e-6)
    np.testing.assert_allclose(model.face_colours, np.tile([1, 128 / 255, 0], (24, 1)), atol=1e-6)


def test_every_group_becomes_one_part_even_with_shared_or_relative_vertices(tmp_path):
    path = tmp_path / "collision.obj"
    corners = "\n".join(f"v {x} {y} {z}" for z in (0, 1, 2) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1)))
    lower = "f 4 3 2 1\nf 5 6 7 8\nf 1/1 2/2 6/3 5/4\nf 2//1 3//1 7//1 6//1\nf 3 4 8 7\nf 4 1 5 8"
    upper = "f -5 -6 -7 -8\nf -4 -3 -2 -1\nf -8 -7 -3 -4\nf -7 -6 -2 -3\nf -6 -5 -1 -2\nf -5 -8 -4 -1"
    path.write_text(
        f"# a comment\nmtllib a.mtl\n{corners}\no lower\nusemtl a\n{lower}\ng upper\ns off\n{upper}\no nothing\n"
    )
    parts = load_parts(path)
    assert [part.volume for part in parts] == pytest.approx([1.0, 1.0])
    assert [part.bounds[:, 2].tolist() for part in parts] == [[0, 1], [1, 2]]


def test_a_file_without_groups_is_one_part(tmp_path, write_obj):
    path = write_obj(tmp_path / "collision.obj", [shapes.sphere(0.05)])
    path.write_text(path.read_text().replace("o convex_0\n", ""))
    assert len(read_groups(path)) == 1


def test_parts_are_repaired_when_they_nearly_fill_their_hull(tmp_path, write_obj):
    box = shapes.box((0.1, 0.1, 0.1))
    parts = load_parts(write_obj(tmp_path / "collision.obj", [without_faces(box, 1), inside_out(box)]))
    for part in parts:
        assert part.is_watertight
        assert part.volume == pytest.approx(0.001, rel=1e-5)


def test_a_hull_of_many_vertices_is_thinned_out_and_stays_almost_as_large(tmp_path, write_obj):
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.05)
    (part,) = load_parts(write_obj(tmp_path / "collision.obj", [ball]))
    assert len(part.vertices) <= 64
    assert part.volume > 0.85 * ball.volume
    np.testing.assert_allclose(part.bounds, ball.bounds, atol=1e-8)


def test_a_flat_sliver_on_the_face_of_another_part_is_left_out(tmp_path, write_obj):
    sliver = trimesh.Trimesh([(0, 0, 0.05), (0.02, 0, 0.05), (0, 0.02, 0.05)], [(0, 1, 2)], process=False)
    parts = load_parts(write_obj(tmp_path / "collision.obj", [shapes.box((0.1, 0.1, 0.1)), sliver]))
    assert len(parts) == 1


def test_a_flat_part_that_stands_alone_is_an_error(tmp_path, write_obj):
    sheet = trimesh.Trimesh([(0, 0, 0), (0.1, 0, 0), (0.1, 0.1, 0), (0, 0.1, 0)], [(0, 1, 2), (0, 2, 3)], process=False)
    far = trimesh.Trimesh(sheet.vertices + np.array([0.2, 0, 0]), sheet.faces, process=False)
    for index, parts in enumerate(([sheet], [far, shapes.box((0.1, 0.1, 0.1))])):
        path = write_obj(tmp_path / str(index) / "collision.obj", parts)
        with pytest.raises(MeshError, match=r"part 0 of .*collision.obj is degenerate: it has no volume; remove it"):
            load_parts(path)


def test_a_part_with_a_large_hole_is_an_error(tmp_path, write_obj):
    path = write_obj(tmp_path / "collision.obj", [without_faces(shapes.box((0.1, 0.1, 0.1)), 4)])
    with pytest.raises(MeshError, match=r"part 0 of .*fills 67% of its convex hull.*close it, or split it"):
        load_parts(path)


def test_a_part_that_is_not_convex_is_an_error(tmp_path, write_obj):
    outline = np.array([(0, 0), (0.1, 0), (0.1, 0.02), (0.02, 0.02), (0.02, 0.1), (0, 0.1)])
    bottom, top = (np.column_stack([outline, np.full(6, z)]) for z in (0.0, 0.02))
    cap = np.array([(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)])
    sides = [face for i in range(6) for j in [(i + 1) % 6] for face in ((i, j, j + 6), (i, j + 6, i + 6))]
    elbow = trimesh.Trimesh(np.vstack([bottom, top]), np.vstack([cap[:, ::-1], cap + 6, sides]), process=False)
    assert elbow.is_volume
    with pytest.raises(MeshError, match="it is open or not convex"):
        load_parts(write_obj(tmp_path / "collision.obj", [elbow]))


@pytest.mark.parametrize("name", ["collision.obj", "visual.ply"])
def test_a_missing_file_is_named(tmp_path, write_object, name):
    folder = write_object(tmp_path / "a")
    (folder / name).unlink()
    with pytest.raises(MeshError, match=rf"{re.escape(str(folder / name))} is missing"):
        load_object(folder)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("collision.obj", b"", "is empty: it has no faces"),
        ("collision.obj", b"v 0 0 0\nv 1 0 0\n", "is empty: it has no faces"),
        ("collision.obj", b"\xff\xfe\x00binary", "cannot read"),
        ("collision.obj", b"v 0 0 zero\n", "line 1, is not valid OBJ"),
        ("collision.obj", b"v 0 0\n", "line 1, is not valid OBJ"),
        ("collision.obj", b"v 0 0 0\nf 1 2 3\n", "line 2, is not valid OBJ: a face names vertex 2 of 1"),
        ("collision.obj", b"v 0 0 0\nf 1 1\n", "line 2, is not valid OBJ: a face needs three corners"),
        ("visual.ply", b"", "cannot read|is empty"),
        ("visual.ply", b"not a mesh at all", "cannot read|is empty"),
        ("visual.ply", b"ply\nformat ascii 1.0\nend_header\n", "cannot read|is empty"),
    ],
)
def test_an_unreadable_or_empty_file_is_named(tmp_path, write_object, name, content, message):
    folder = write_object(tmp_path / "a")
    (folder / name).write_bytes(content)
    with pytest.raises(MeshError, match=message) as caught:
        load_object(folder)
    assert str(folder / name) in str(caught.value)


def test_a_visual_that_was_cut_short_is_an_error(tmp_path, write_object):
    folder = write_object(tmp_path / "a")
    content = (folder / "visual.ply").read_bytes()
    (folder / "visual.ply").write_bytes(content[: len(content) - 40])
    with pytest.raises(MeshError, match=r"visual.ply"):
        load_object(folder)


@pytest.mark.parametrize("value", ["nan", "inf", "-inf"])
def test_vertices_that_are_not_finite_are_an_error(tmp_path, write_object, value):
    folder = write_object(tmp_path / "a")
    path = folder / "collision.obj"
    path.write_text(re.sub(r"v \S+", f"v {value}", path.read_text(), count=1))
    with pytest.raises(MeshError, match=r"collision.obj has a vertex that is NaN or infinite"):
        load_object(folder)


def test_a_visual_vertex_that_is_not_finite_is_an_error(tmp_path, write_object):
    folder = write_object(tmp_path / "a")
    broken = shapes.box((0.1, 0.1, 0.1))
    broken.vertices[0, 0] = np.nan
    broken.export(folder / "visual.ply")
    with pytest.raises(MeshError, match=r"visual.ply has a vertex that is NaN or infinite"):
        load_object(folder)


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_an_absurd_scale_is_an_error(tmp_path, write_object, scale):
    folder = write_object(tmp_path / "a", scale=scale * 0.1 if scale < 1 else scale)
    with pytest.raises(MeshError, match=r"m across, outside 0.001 to 10 m; convert it to metres"):
        load_object(folder)


def test_collision_and_visual_in_different_units_are_an_error(tmp_path, write_object):
    folder = write_object(tmp_path / "a")
    trimesh.load(folder / "visual.ply").apply_scale(10).export(folder / "visual.ply")
    with pytest.raises(MeshError, match=r"0.1 times as large as the visual mesh; bring both to the same unit"):
        load_object(folder)


def test_a_visual_of_many_triangles_is_simplified_and_keeps_shape_and_colours(tmp_path):
    pytest.importorskip("open3d")
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.05)
    ball.visual.vertex_colors = np.where(ball.vertices[:, 2:] > 0, [255, 0, 0, 255], [0, 0, 255, 255]).astype(np.uint8)
    ball.export(tmp_path / "visual.ply")
    mesh, colours = load_visual(tmp_path / "visual.ply")
    assert VISUAL_FACES_MAX / 2 < len(mesh.faces) <= VISUAL_FACES_MAX
    assert mesh.volume == pytest.approx(ball.volume, rel=0.01)
    heights = mesh.triangles_center[:, 2]
    np.testing.assert_allclose(colours[heights > 0.01], [[1, 0, 0]] * (heights > 0.01).sum(), atol=1e-3)
    np.testing.assert_allclose(colours[heights < -0.01], [[0, 0, 1]] * (heights < -0.01).sum(), atol=1e-3)


def test_without_open3d_a_large_visual_says_what_to_do(tmp_path, monkeypatch):
    trimesh.creation.icosphere(subdivisions=4, radius=0.05).export(tmp_path / "visual.ply")
    monkeypatch.setitem(sys.modules, "open3d", None)
    with pytest.raises(MissingSystemLibraryError, match="run `tr-grasp doctor`"):
        load_visual(tmp_path / "visual.ply")


def test_an_inside_out_visual_is_turned_and_an_uncoloured_one_is_grey(tmp_path):
    inside_out(shapes.box((0.1, 0.1, 0.1))).export(tmp_path / "visual.ply")
    mesh, colours = load_visual(tmp_path / "visual.ply")
    assert mesh.volume == pytest.approx(0.001, rel=1e-5)
    np.testing.assert_allclose(colours, GREY)


def test_groups_that_are_written_are_read_back_bit_by_bit(tmp_path):
    rng = np.random.default_rng(0)
    written = [(rng.normal(size=(5, 3)), rng.integers(0, 5, (4, 3))) for _ in range(3)]
    written = [
        (vertices[np.unique(faces)], np.unique(faces, return_inverse=True)[1].reshape(-1, 3))
        for vertices, faces in written
    ]
    (tmp_path / "parts.obj").write_text(groups_text(written))
    for (vertices, faces), (vertices_again, faces_again) in zip(
        written, read_groups(tmp_path / "parts.obj"), strict=True
    ):
        np.testing.assert_array_equal(vertices, vertices_again)
        np.testing.assert_array_equal(faces, faces_again)


@pytest.mark.parametrize("name", ["collision.obj", "visual.ply", "visual.obj"])
def test_a_million_triangles_are_refused_without_being_read(tmp_path, write_object, name, monkeypatch):
    folder = write_object(tmp_path / "a")
    if name.endswith(".ply"):
        content = (folder / name).read_bytes()
        (folder / name).write_bytes(re.sub(rb"element face \d+", b"element face 1000000", content))
    else:
        (folder / "visual.ply").unlink(missing_ok=name == "visual.obj")
        write_object(folder) if name == "collision.obj" else None
        (folder / name).write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n" + "f 1 2 3\n" * 1_000_000)
    monkeypatch.setattr(trimesh, "load", lambda *_, **__: pytest.fail("the mesh was read"))
    with pytest.raises(
        RejectedMesh, match=rf"{name} has 1,000,000 triangles, more than the 40,000 .*; simplify it"
    ) as caught:
        load_visual(folder / name) if name.startswith("visual") else load_parts(folder / name)
    assert caught.value.reason is Reason.TOO_MANY_FACES


def test_forty_thousand_faces_are_not_too_many_but_one_more_is(tmp_path):
    for faces_n, refused in ((40_000, False), (40_001, True)):
        (tmp_path / "a.obj").write_text("f 1 2 3\n" * faces_n)
        if refused:
            with pytest.raises(RejectedMesh, match="40,001 triangles"):
                require_few_faces(tmp_path / "a.obj")
        else:
            require_few_faces(tmp_path / "a.obj")


def test_two_boxes_that_are_far_apart_are_two_objects(tmp_path, write_object, write_obj):
    folder = write_object(tmp_path / "pair")
    boxes = [shapes.box((0.05, 0.05, 0.05)), shapes.box((0.05, 0.05, 0.05), (0.1, 0.0, 0.0))]
    write_obj(folder / "collision.obj", boxes)
    with pytest.raises(
        RejectedMesh, match=r"pair falls into 2 large pieces with more than 8\.3 mm between them"
    ) as caught:
        load_object(folder)
    assert caught.value.reason is Reason.SEVERAL_PIECES


def test_a_crumb_beside_an_object_is_no_second_object(tmp_path, write_object, write_obj):
    folder = write_object(tmp_path / "crumbs")
    boxes = [shapes.box((0.05, 0.05, 0.05)), shapes.box((0.01, 0.01, 0.01), (0.06, 0.0, 0.0))]
    write_obj(folder / "collision.obj", boxes)
    assert len(load_object(folder).parts) == 2


def test_a_wire_has_degenerate_inertia(tmp_path, write_object, write_obj):
    folder = write_object(tmp_path / "wire")
    wire = shapes.box((0.1, 0.0005, 0.0005))
    write_obj(folder / "collision.obj", [wire])
    wire.export(folder / "visual.ply")
    # Moments of 0.5 x 0.5 mm over 100 mm: 2 to 40,000.
    with pytest.raises(RejectedMesh, match=r"as thin as a wire: .* by a factor of 2e\+04, more than 1e\+04") as caught:
        load_object(folder)
    assert caught.value.reason is Reason.DEGENERATE_INERTIA
