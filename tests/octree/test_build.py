from __future__ import annotations

import warnings
from collections import defaultdict

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from tests.octree.clouds import SPEC, Cloud, random_cloud
from tr_grasp.octree import (
    LeafOverflowWarning,
    OctreeFrame,
    OctreeSpec,
    build,
    count_octree_from_points,
    octree_from_points,
    octrees_from_clouds,
)
from tr_grasp.octree.morton import encode_cells

UNIT = OctreeSpec(origin_m=(0.0, 0.0, 0.0), side_m=8.0, depth=3, leaf_capacity=16)
"""Leaves of 1 m, so that expected values can be read off."""

UP = [0.0, 0.0, 1.0]
GREY = [0.5, 0.5, 0.5]


def slow_octree(cloud: Cloud, spec: OctreeSpec) -> dict[int, list[float]]:
    """Leaf features by code, from the definition, one point at a time."""
    members = defaultdict(list)
    for point, normal, colour in zip(*cloud, strict=True):
        place = (point - np.array(spec.origin_m)) / spec.leaf_m
        cell = np.floor(place).astype(int)
        if ((cell >= 0) & (cell < spec.cells_n)).all():
            members[tuple(cell)].append((place, normal, colour))
    leaves = {}
    for cell, rows in members.items():
        bits = [format(c, f"0{spec.depth}b") for c in cell]
        code = int("".join(x + y + z for x, y, z in zip(*bits, strict=True)), 2)
        normal = np.sum([row[1] for row in rows], axis=0)
        normal = normal / np.linalg.norm(normal)
        mean = np.mean([row[0] for row in rows], axis=0)
        distance = 2 / np.sqrt(3) * np.dot(mean - np.floor(mean) - 0.5, normal)
        leaves[code] = [*normal, distance, *np.mean([row[2] for row in rows], axis=0)]
    return leaves


def as_dict(frame: OctreeFrame) -> dict[int, list[float]]:
    n = int(frame.leaves_n)
    return dict(zip(frame.codes[:n].tolist(), frame.features[:n].tolist(), strict=True))


@given(seed=st.integers(0, 10_000), n=st.integers(1, 400), depth=st.sampled_from([3, 4, 5, 6]))
def test_a_frame_holds_what_the_definition_says(seed: int, n: int, depth: int) -> None:
    spec = OctreeSpec(SPEC.origin_m, SPEC.side_m, depth)
    cloud = random_cloud(seed, n, spec, spread=1.1)
    expected, built = slow_octree(cloud, spec), octree_from_points(*cloud, spec)
    assert built.codes[: len(expected)].tolist() == sorted(expected)
    assert (built.codes[len(expected) :] == -1).all()
    assert (built.features[len(expected) :] == 0).all()
    for code, features in as_dict(built).items():
        np.testing.assert_allclose(features, expected[code], atol=1e-3)


@given(seed=st.integers(0, 10_000))
def test_the_order_of_the_points_does_not_matter(seed: int) -> None:
    cloud = random_cloud(seed, 300, spread=0.3)
    order = np.random.default_rng(seed).permutation(300)
    a, b = octree_from_points(*cloud, SPEC), octree_from_points(*(array[order] for array in cloud), SPEC)
    assert torch.equal(a.codes, b.codes)
    torch.testing.assert_close(a.features, b.features, atol=1e-3, rtol=0)  # a sum may round to the other float16


def test_two_points_in_a_leaf_worked_by_hand() -> None:
    points = [[1.5, 2.5, 4.25], [1.5, 2.5, 4.75 + 0.1]]
    frame = octree_from_points(points, [UP, UP], [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], UNIT)
    # x = 001, y = 010, z = 100: the triples, from the highest bit on, are (0 0 1), (0 1 0), (1 0 0).
    assert frame.codes.tolist() == [0b001_010_100] + [-1] * 15
    distance = 2 / np.sqrt(3) * 0.05
    np.testing.assert_allclose(frame.features[0], [0, 0, 1, distance, 0.5, 0, 0.5], atol=1e-3)


def test_x_is_the_most_significant_bit_of_a_triple() -> None:
    assert encode_cells(np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [2, 0, 0]]), 3).tolist() == [4, 2, 1, 32]


def test_the_signed_distance_is_one_at_the_corner_to_which_the_normal_points() -> None:
    diagonal = np.ones(3) / np.sqrt(3)
    frame = octree_from_points([[0.9999] * 3, [1.0001] * 3], [diagonal] * 2, [GREY] * 2, UNIT)
    np.testing.assert_allclose(frame.features[:2, 3], [1.0, -1.0], atol=1e-3)


def test_opposite_normals_leave_the_first_one() -> None:
    down = [0.0, 0.0, -1.0]
    points = [[5.5, 5.5, 5.5], [0.5, 0.5, 0.5], [0.5, 0.5, 0.5]]
    frame = octree_from_points(points, [UP, down, UP], [GREY] * 3, UNIT)
    assert frame.features[0, :3].tolist() == down


def test_points_outside_and_rows_that_are_not_finite_are_left_out() -> None:
    inside = [0.5, 0.5, 0.5]
    points = [inside, [8.0, 1, 1], [-0.001, 1, 1], [np.nan, 1, 1], [np.inf, 1, 1], inside, inside]
    normals = [UP] * 5 + [[np.nan, 0, 1], UP]
    colours = [[0.25] * 3] * 6 + [[-np.inf, np.inf, 0]]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        frame = octree_from_points(points, normals, colours, UNIT)
    assert as_dict(frame) == {0: [0, 0, 1, 0, 0.25, 0.25, 0.25]}


def test_points_on_the_lower_faces_belong_to_the_cube_and_on_the_upper_faces_not() -> None:
    frame = octree_from_points([[0.0, 0.0, 0.0], [8.0, 8.0, 8.0]], [UP] * 2, [GREY] * 2, UNIT)
    assert frame.codes[:2].tolist() == [0, -1]


@pytest.mark.parametrize("far", [[], [[100.0, 0, 0]], [[np.nan] * 3]])
def test_nothing_in_the_cube_gives_an_empty_frame(far: list[list[float]]) -> None:
    points = np.array(far).reshape(-1, 3)
    frame = octree_from_points(points, points, points, SPEC)
    assert int(frame.leaves_n) == 0
    assert torch.equal(frame.features, torch.zeros(512, 7, dtype=torch.float16))


def test_a_full_frame_keeps_the_leaves_with_most_points_and_then_the_smaller_codes() -> None:
    spec = OctreeSpec(UNIT.origin_m, UNIT.side_m, depth=3, leaf_capacity=3)
    z = [0.5, 1.5, 1.5, 2.5, 3.5, 3.5, 3.5, 4.5]  # points in the leaves 0, 1, 8, 9 and 64: 1, 2, 1, 3 and 1
    cloud = [[0.5, 0.5, h] for h in z], [UP] * 8, [GREY] * 8
    frame, ignored_n, dropped_n = count_octree_from_points(*cloud, spec)
    assert frame.codes.tolist() == [0, 1, 9]
    assert (ignored_n, dropped_n) == (0, 2)
    np.testing.assert_allclose(frame.features[:, 3], 0, atol=1e-3)
    with pytest.warns(LeafOverflowWarning, match="leaf_capacity=3"):
        assert torch.equal(octree_from_points(*cloud, spec).codes, frame.codes)


def test_what_stays_of_a_full_frame_is_what_a_larger_one_holds_of_these_leaves() -> None:
    cloud = random_cloud(11, 900)
    small, large = (OctreeSpec(SPEC.origin_m, SPEC.side_m, leaf_capacity=n) for n in (100, 4096))
    frame, _, dropped_n = count_octree_from_points(*cloud, small)
    everything = as_dict(octree_from_points(*cloud, large))
    assert len(everything) == 100 + dropped_n
    assert all(everything[code] == features for code, features in as_dict(frame).items())


@given(
    seed=st.integers(0, 10_000),
    sizes=st.lists(st.integers(0, 150), max_size=6),
    chunk=st.sampled_from([1, 200, 10_000]),
    capacity=st.sampled_from([20, 512]),
    spread=st.floats(0.1, 1.2),
)
def test_a_batch_is_its_clouds_one_by_one(
    seed: int, sizes: list[int], chunk: int, capacity: int, spread: float
) -> None:
    spec = OctreeSpec(SPEC.origin_m, SPEC.side_m, leaf_capacity=capacity)
    clouds = [random_cloud(seed + index, n, spec, spread) for index, n in enumerate(sizes)]
    with pytest.MonkeyPatch.context() as patch, warnings.catch_warnings():
        warnings.simplefilter("ignore", LeafOverflowWarning)
        patch.setattr(build, "CHUNK_POINTS", chunk)
        frames = octrees_from_clouds(clouds, spec)
        expected = [octree_from_points(*cloud, spec) for cloud in clouds]
    assert frames.batch_size == (len(sizes),)
    for index, frame in enumerate(expected):
        assert torch.equal(frames.codes[index], frame.codes)
        assert torch.equal(frames.features[index], frame.features)


def test_clouds_of_a_batch_do_not_share_leaves_and_their_opposite_normals_stay_apart() -> None:
    down = [0.0, 0.0, -1.0]
    at = [[0.5, 0.5, 0.5]]
    frames = octrees_from_clouds([(at, [UP], [GREY]), (at * 2, [down, UP], [GREY] * 2)], UNIT)
    assert frames.codes[:, :2].tolist() == [[0, -1], [0, -1]]
    assert frames.features[:, 0, :3].tolist() == [UP, down]


def test_a_batch_with_a_full_frame_warns() -> None:
    spec = OctreeSpec(UNIT.origin_m, UNIT.side_m, depth=3, leaf_capacity=1)
    one, two = ([[[0.5, 0.5, h + 0.5] for h in range(n)], [UP] * n, [GREY] * n] for n in (1, 2))
    with pytest.warns(LeafOverflowWarning, match="leaf_capacity=1"):
        assert octrees_from_clouds([one, two], spec).codes.tolist() == [[0], [0]]


def test_a_bad_cloud_of_a_batch_is_named() -> None:
    good = [[[0.5, 0.5, 0.5]], [UP], [GREY]]
    with pytest.raises(ValueError, match="cloud 1: normals must have shape"):
        octrees_from_clouds([good, [good[0], [[1.0, 0.0]], good[2]]], UNIT)
    with pytest.raises(ValueError, match="cloud 0: a cloud is points, normals and colours"):
        octrees_from_clouds([good[:2]], UNIT)


def test_ignored_points_are_counted() -> None:
    points = [[0.5, 0.5, 0.5], [9.0, 1, 1], [np.nan, 1, 1]]
    built = count_octree_from_points(points, [UP] * 3, [GREY] * 3, UNIT)
    assert built[1:] == (2, 0)


def test_points_given_twice_count_once() -> None:
    cloud = random_cloud(12)
    twice = octree_from_points(*(np.concatenate([array, array]) for array in cloud), SPEC)
    once = octree_from_points(*cloud, SPEC)
    assert torch.equal(twice.codes, once.codes)
    torch.testing.assert_close(twice.features, once.features, atol=1e-3, rtol=0)


def test_every_leaf_of_the_deepest_cube_has_its_code() -> None:
    spec = OctreeSpec((0.0, 0.0, 0.0), 64.0, depth=6, leaf_capacity=4)
    points = [[0.5, 0.5, 0.5], [63.5, 63.5, 63.5], [32.5, 0.5, 0.5]]
    frame = octree_from_points(points, [UP] * 3, [GREY] * 3, spec)
    assert frame.codes.dtype == torch.int32
    assert frame.codes.tolist() == [0, 4 << 15, 8**6 - 1, -1]


def test_numpy_and_torch_of_any_float_type_agree() -> None:
    cloud = random_cloud(3)
    single = [array.astype(np.float32) for array in cloud]
    a = octree_from_points(*single, SPEC)
    b = octree_from_points(*(torch.from_numpy(array) for array in single), SPEC)
    assert torch.equal(a.codes, b.codes)
    assert torch.equal(a.features, b.features)


def test_half_precision_and_whole_numbers_are_read_too() -> None:
    points, normals, colours = [[1, 2, 4], [1, 2, 5]], [[0, 0, 1]] * 2, [[1, 0, 0]] * 2
    expected = octree_from_points(*(np.array(rows, float) for rows in (points, normals, colours)), UNIT)
    for dtype in (torch.int64, torch.float16, torch.bfloat16):
        frame = octree_from_points(*(torch.tensor(rows, dtype=dtype) for rows in (points, normals, colours)), UNIT)
        assert torch.equal(frame.codes, expected.codes)
        assert torch.equal(frame.features, expected.features)


@pytest.mark.parametrize("points", [np.full((4, 3), "a"), np.ones((4, 3), complex), np.ones((4, 3), bool)])
def test_what_is_no_number_is_refused(points: np.ndarray) -> None:
    with pytest.raises(ValueError, match="points must hold real numbers"):
        octree_from_points(points, np.zeros((4, 3)), np.zeros((4, 3)), UNIT)


def test_building_does_not_change_its_input() -> None:
    cloud = random_cloud(4)
    before = [array.copy() for array in cloud]
    octree_from_points(*cloud, SPEC)
    for array, copy in zip(cloud, before, strict=True):
        np.testing.assert_array_equal(array, copy)


def test_without_colour_a_leaf_has_four_channels_and_they_are_the_same() -> None:
    cloud = random_cloud(5)
    spec = OctreeSpec(SPEC.origin_m, SPEC.side_m, colour=False)
    assert spec.channels == 4
    plain = octree_from_points(cloud.points, cloud.normals, None, spec)
    assert torch.equal(plain.features, octree_from_points(*cloud, SPEC).features[:, :4])


@pytest.mark.parametrize(
    ("normals", "colours", "culprit"),
    [(np.zeros((4, 3)), np.zeros((5, 3)), "normals"), (np.zeros((5, 3)), np.zeros((5, 4)), "colours")],
)
def test_arrays_that_do_not_belong_together_are_named(normals, colours, culprit: str) -> None:
    with pytest.raises(ValueError, match=f"{culprit} must have shape"):
        octree_from_points(np.zeros((5, 3)), normals, colours, SPEC)


def test_missing_colours_are_an_error_where_the_spec_stores_them() -> None:
    with pytest.raises(ValueError, match="colours"):
        octree_from_points(np.zeros((1, 3)), np.zeros((1, 3)), None, SPEC)
