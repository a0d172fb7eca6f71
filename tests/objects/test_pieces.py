from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from tr_grasp.objects import FAMILIES, shapes
from tr_grasp.objects.pieces import hull_distance, pieces_of


def slow_distance(first: np.ndarray, second: np.ndarray) -> float:
    """Between convex hulls: the best weights of the corners by a general solver."""
    n = len(first)

    def squared(weights: np.ndarray) -> float:
        return float(np.sum((weights[:n] @ first - weights[n:] @ second) ** 2))

    sums = [{"type": "eq", "fun": lambda w: w[:n].sum() - 1}, {"type": "eq", "fun": lambda w: w[n:].sum() - 1}]
    start = np.concatenate([np.full(n, 1 / n), np.full(len(second), 1 / len(second))])
    found = minimize(squared, start, bounds=[(0, 1)] * len(start), constraints=sums, options={"ftol": 1e-12})
    return float(np.sqrt(found.fun))


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), shift=st.floats(0, 4), scale=st.sampled_from([0.01, 1.0]))
def test_the_distance_of_hulls_is_that_of_a_general_solver(seed, shift, scale):
    rng = np.random.default_rng(seed)
    first, second = rng.uniform(-1, 1, (6, 3)), rng.uniform(-1, 1, (5, 3)) + np.array([shift, 0, 0])
    assert hull_distance(scale * first, scale * second) == pytest.approx(
        scale * slow_distance(first, second), rel=1e-3, abs=1e-3 * scale
    )


@pytest.mark.parametrize(
    ("centre", "distance"), [((0.5, 0.0, 0.0), 0.0), ((3.0, 0.2, 0.0), 2.0), ((4.0, 5.0, 0.0), 5.0)]
)
def test_boxes_are_apart_by_a_face_or_an_edge(centre, distance):
    first, second = shapes.box((1, 1, 1)).vertices, shapes.box((1, 1, 1), centre).vertices
    assert hull_distance(first, second) == pytest.approx(distance, abs=1e-5)


def test_bars_that_cross_without_a_corner_in_the_other_are_one_piece():
    bars = [shapes.box((1, 0.1, 0.1)), shapes.box((0.1, 1, 0.1)), shapes.box((0.1, 0.1, 0.1), (0.0, 0.0, 0.5))]
    assert pieces_of(bars, 0.01) == [[0, 1], [2]]
    assert pieces_of(bars, 0.41) == [[0, 1, 2]]


def test_a_late_part_joins_pieces_that_were_apart():
    ends = [shapes.box((1, 1, 1), (x, 0.0, 0.0)) for x in (0.0, 4.0)]
    assert pieces_of(ends, 0.01) == [[0], [1]]
    assert pieces_of([*ends, shapes.box((3, 0.1, 0.1), (2.0, 0.0, 0.0))], 0.01) == [[0, 1, 2]]


def test_every_procedural_object_is_one_piece():
    rng = np.random.default_rng(0)
    for family in FAMILIES.values():
        model = family.sample("test", rng)
        assert len(pieces_of(model.parts, 1e-4)) == 1, family.name
