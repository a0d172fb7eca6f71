from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest

from tr_grasp.errors import ConfigError
from tr_grasp.geometry import matrix_from_wxyz, random_wxyz
from tr_grasp.objects import random_orientation

DRAWS_N = 20_000


@lru_cache
def draws(kind: str) -> np.ndarray:
    rng = np.random.default_rng(0)
    return np.array([random_orientation(kind, rng) for _ in range(DRAWS_N)])  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", ["uniform", "thesis", "upright_yaw"])
def test_every_draw_is_a_unit_quaternion_and_equal_generators_draw_equally(kind):
    np.testing.assert_allclose(np.linalg.norm(draws(kind), axis=1), 1)
    first, again = (random_orientation(kind, np.random.default_rng(1)) for _ in range(2))
    np.testing.assert_array_equal(first, again)


def test_uniform_is_what_scenes_have_drawn_so_far():
    rng = np.random.default_rng(3)
    np.testing.assert_array_equal(random_orientation("uniform", np.random.default_rng(3)), random_wxyz(rng))


def test_uniform_turns_of_any_size_are_as_frequent_as_they_should_be():
    # The turn of a uniform rotation has the distribution function (angle - sin angle) / pi.
    angles = 2 * np.arccos(np.abs(draws("uniform")[:, 0]))
    for angle in (1.0, 2.0, 2.8):
        assert np.mean(angles < angle) == pytest.approx((angle - np.sin(angle)) / np.pi, abs=0.02)


def test_the_thesis_favours_the_corners_of_the_cube():
    # In any direction the density is that of a uniform one times pi^2 / 32 = 0.31 and the fourth power of how far the
    # cube reaches that way: 1 towards a face, 2 towards a corner. Caps of 14 degrees average that to 0.33 and 2.34.
    thesis, uniform = np.abs(draws("thesis")), np.abs(draws("uniform"))

    def near_a_face(q: np.ndarray) -> float:
        return float((q.max(axis=1) > 0.97).mean())

    def near_a_corner(q: np.ndarray) -> float:
        return float((q.sum(axis=1) / 2 > 0.97).mean())

    assert near_a_face(thesis) / near_a_face(uniform) == pytest.approx(0.33, rel=0.2)
    assert near_a_corner(thesis) / near_a_corner(uniform) == pytest.approx(2.34, rel=0.2)


def test_upright_objects_stay_upright_and_face_every_way():
    rotations = matrix_from_wxyz(draws("upright_yaw"))
    np.testing.assert_allclose(rotations[:, 2, 2], 1)
    yaw = np.arctan2(rotations[:, 1, 0], rotations[:, 0, 0])
    shares, _ = np.histogram(yaw, bins=8, range=(-np.pi, np.pi))
    np.testing.assert_allclose(shares / DRAWS_N, 1 / 8, atol=0.02)


def test_an_unknown_kind_names_the_valid_ones():
    with pytest.raises(ConfigError, match=r"unknown objects.orientation 'unifrom'; did you mean 'uniform'\?"):
        random_orientation("unifrom", np.random.default_rng(0))  # type: ignore[arg-type]
