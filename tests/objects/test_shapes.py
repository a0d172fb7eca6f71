from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from tr_grasp.objects import shapes
from tr_grasp.objects.model import volume_and_centre

SIZES = st.floats(0.005, 0.2)


def assert_convex_solid(solid: trimesh.Trimesh) -> None:
    assert solid.is_watertight
    assert solid.is_winding_consistent
    assert solid.volume > 0
    assert solid.volume == pytest.approx(solid.convex_hull.volume, rel=1e-6)


@settings(max_examples=30, deadline=None)
@given(radius=SIZES, top=SIZES, height=SIZES, sides=st.integers(3, 24))
def test_a_frustum_is_a_convex_solid_with_the_volume_of_its_polygons(radius, top, height, sides):
    solid = shapes.revolved([(radius, 0.0), (top, height)], sides)
    assert_convex_solid(solid)
    polygon_share = sides / 2 * np.sin(2 * np.pi / sides)
    assert solid.volume == pytest.approx(polygon_share * height / 3 * (radius**2 + radius * top + top**2))


@settings(max_examples=20, deadline=None)
@given(radius=SIZES, straight=st.one_of(st.just(0.0), SIZES))
def test_a_capsule_is_a_convex_solid_inside_the_round_one(radius, straight):
    solid = shapes.capsule(radius, straight)
    assert_convex_solid(solid)
    assert len(solid.vertices) <= 64
    beyond_axis = np.maximum(np.abs(solid.vertices[:, 2]) - straight / 2, 0)
    distances = np.hypot(np.linalg.norm(solid.vertices[:, :2], axis=1), beyond_axis)
    np.testing.assert_allclose(distances, radius, rtol=1e-9)
    assert solid.extents[2] == pytest.approx(straight + 2 * radius)


@settings(max_examples=20, deadline=None)
@given(low=st.floats(0.02, 0.1), high=st.floats(0.02, 0.1), height=SIZES, share=st.floats(0.05, 0.9))
def test_a_wall_is_what_is_left_of_a_frustum_without_its_inside(low, high, height, share):
    thickness = share * min(low, high)
    wedges = shapes.wall(low, high, thickness, 0.0, height)
    for wedge in wedges:
        assert_convex_solid(wedge)
    outer = shapes.revolved([(low, 0.0), (high, height)], shapes.WALL_SIDES)
    inner = shapes.revolved([(low - thickness, 0.0), (high - thickness, height)], shapes.WALL_SIDES)
    assert sum(wedge.volume for wedge in wedges) == pytest.approx(outer.volume - inner.volume, rel=1e-6)


def test_a_box_has_its_corners_where_they_belong():
    solid = shapes.box((0.2, 0.4, 0.6), (1.0, 2.0, 3.0))
    assert_convex_solid(solid)
    np.testing.assert_allclose(solid.bounds, [[0.9, 1.8, 2.7], [1.1, 2.2, 3.3]])
    assert len(solid.vertices) == 8
    assert len(solid.faces) == 12


def test_a_pyramid_has_a_third_of_the_volume_of_its_box_and_its_centre_a_quarter_up():
    volume, centre = volume_and_centre(shapes.loft([[(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], [(0, 0, 3)]]))
    assert volume == pytest.approx(4.0)
    np.testing.assert_allclose(centre, [0, 0, 0.75], atol=1e-12)


def test_a_lying_solid_points_along_x_and_is_not_mirrored():
    solid = shapes.lying(shapes.box((0.1, 0.2, 0.3), (0.0, 0.0, 1.0)))
    np.testing.assert_allclose(solid.bounds, [[0.85, -0.05, -0.1], [1.15, 0.05, 0.1]])
    assert solid.volume > 0


def test_a_flat_side_and_not_a_corner_faces_x():
    solid = shapes.cylinder(0.1, 0.0, 0.1, sides=shapes.WALL_SIDES)
    assert solid.bounds[1, 0] == pytest.approx(shapes.flat_radius(0.1))
    assert solid.bounds[1, 0] < 0.1
