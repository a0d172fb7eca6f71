from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from tr_grasp.objects import ObjectModel, shapes
from tr_grasp.objects.model import distance_outside, volume_and_centre


def model_of(*parts: trimesh.Trimesh) -> ObjectModel:
    visual = trimesh.util.concatenate(parts)
    return ObjectModel.assemble("thing", "things", parts, visual, np.full((len(visual.faces), 3), 0.5))


SIZES = st.floats(0.01, 0.2)
OFFSETS = st.floats(-1.0, 1.0)


@settings(max_examples=30, deadline=None)
@given(size=st.tuples(SIZES, SIZES, SIZES), centre=st.tuples(OFFSETS, OFFSETS, OFFSETS), factor=st.floats(0.1, 10))
def test_a_box_anywhere_is_the_same_model_and_scales_with_the_cube_of_the_factor(size, centre, factor):
    model = model_of(shapes.box(size, centre))
    np.testing.assert_allclose(model.bounds_m, [-np.array(size) / 2, np.array(size) / 2], atol=1e-9)
    assert model.volume_m3 == pytest.approx(np.prod(size))
    larger = model.scaled(factor)
    assert larger.volume_m3 == pytest.approx(model.volume_m3 * factor**3)
    assert larger.diagonal_m == pytest.approx(model.diagonal_m * factor)
    assert larger.surface_area_m2 == pytest.approx(model.surface_area_m2 * factor**2)
    assert (larger.name, larger.family) == (model.name, model.family)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_volume_and_centre_are_those_of_trimesh_for_any_hull(seed):
    hull = trimesh.convex.convex_hull(np.random.default_rng(seed).uniform(-1, 1, (20, 3)) + 5)
    volume, centre = volume_and_centre(hull)
    assert volume == pytest.approx(hull.volume)
    np.testing.assert_allclose(centre, hull.center_mass, atol=1e-9)


def test_the_origin_of_two_boxes_lies_between_them_weighted_by_volume():
    # Volumes 1 and 3 litres at x = 0 and x = 0.4: the centre is at 0.3, so the small box goes to -0.3.
    model = model_of(shapes.box((0.1, 0.1, 0.1)), shapes.box((0.3, 0.1, 0.1), (0.4, 0.0, 0.0)))
    assert model.parts[0].vertices.mean(axis=0) == pytest.approx([-0.3, 0, 0])
    assert model.parts[1].vertices.mean(axis=0) == pytest.approx([0.1, 0, 0])
    assert model.visual.bounds[0] == pytest.approx([-0.35, -0.05, -0.05])
    assert model.extents_m == pytest.approx([0.6, 0.1, 0.1])


def test_the_wall_between_two_touching_cubes_does_not_count_as_surface():
    model = model_of(shapes.box((1, 1, 1)), shapes.box((1, 1, 1), (1.0, 0.0, 0.0)))
    assert model.surface_area_m2 == pytest.approx(10.0)
    assert model.volume_m3 == pytest.approx(2.0)


def test_the_inertia_of_a_brick_is_that_of_the_textbook():
    model = model_of(shapes.box((0.1, 0.06, 0.04), (0.3, 0.2, 0.1)))
    expected = 0.3 / 12 * np.array([0.06**2 + 0.04**2, 0.1**2 + 0.04**2, 0.1**2 + 0.06**2])
    np.testing.assert_allclose(model.inertia_kgm2(0.3), np.diag(expected), atol=1e-12)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), factor=st.floats(0.1, 10))
def test_at_one_density_inertia_grows_with_the_fifth_power_of_the_size(seed, factor):
    hull = trimesh.convex.convex_hull(np.random.default_rng(seed).uniform(-1, 1, (20, 3)) + 5)
    model = model_of(hull)
    inertia = model.inertia_kgm2(hull.volume * 400.0)
    np.testing.assert_allclose(inertia, 400.0 * hull.moment_inertia, rtol=1e-6, atol=1e-6 * np.trace(inertia))
    larger = model.scaled(factor)
    np.testing.assert_allclose(
        larger.inertia_kgm2(larger.volume_m3 * 400.0), inertia * factor**5, rtol=1e-6, atol=1e-9 * factor**5
    )


def test_what_one_part_hides_of_another_does_not_count_as_surface():
    # A rod of 1 x 1 x 4 through a cube of 2: 24 + 4 * 4 - 2 faces of 1 x 1 hidden, ends and sides out by 1 each.
    model = model_of(shapes.box((2, 2, 2)), shapes.box((1, 1, 4)))
    assert model.surface_area_m2 == pytest.approx(24 - 2 + 2 + 8, rel=0.05)


def test_distance_outside_a_cube_is_measured_to_the_nearest_face():
    points = np.array([[0, 0, 0], [0.9, 0, 0], [0.5, 0.2, 0.1]])
    np.testing.assert_allclose(distance_outside(shapes.box((1, 1, 1)), points), [-0.5, 0.4, 0.0], atol=1e-12)


def test_a_scaled_copy_leaves_the_original_alone():
    model = model_of(shapes.box((0.1, 0.1, 0.1)))
    model.scaled(2.0)
    assert model.extents_m == pytest.approx([0.1, 0.1, 0.1])


@pytest.mark.parametrize("factor", [0.0, -1.0, float("nan"), float("inf")])
def test_a_factor_that_is_no_size_is_refused(factor):
    with pytest.raises(ValueError, match="factor must be positive"):
        model_of(shapes.box((0.1, 0.1, 0.1))).scaled(factor)


def test_colours_that_do_not_fit_the_faces_are_refused():
    part = shapes.box((0.1, 0.1, 0.1))
    with pytest.raises(ValueError, match=r"must be \(12, 3\), got \(3, 3\)"):
        ObjectModel.assemble("thing", "things", [part], part, np.zeros((3, 3)))


def test_an_object_without_parts_is_refused():
    part = shapes.box((0.1, 0.1, 0.1))
    with pytest.raises(ValueError, match="at least one part"):
        ObjectModel.assemble("thing", "things", [], part, np.zeros((12, 3)))
