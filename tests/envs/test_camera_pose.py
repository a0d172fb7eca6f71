"""Where the task's camera stands."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tr_grasp.configs import CameraArcCfg, CameraCfg, EnvCfg
from tr_grasp.envs.camera_pose import random_camera, random_direction, require_outside, require_view
from tr_grasp.errors import ConfigError
from tr_grasp.geometry import rotation_about_z, transform_from
from tr_grasp.objects import object_set
from tr_grasp.sensing import PinholeCamera

THESIS = EnvCfg()
CENTRE = np.array(THESIS.workspace.centre_m)
signs = st.floats(-1.0, 1.0)


def with_arc(**changes: object) -> EnvCfg:
    return EnvCfg(camera=CameraCfg(arc=replace(CameraArcCfg(), **changes)))


def camera_at(*eye: float) -> PinholeCamera:
    return PinholeCamera.looking_at(eye, CENTRE, 0.47, 20)


@given(seed=st.integers(0, 2**31))
@settings(deadline=None)
def test_a_drawn_camera_stands_on_the_arc_of_the_thesis_and_looks_at_the_centre(seed: int) -> None:
    T = random_camera(THESIS, np.random.default_rng(seed)).T_base_cam
    away = T[:3, 3] - CENTRE
    assert np.linalg.norm(away) == pytest.approx(1.0)
    np.testing.assert_allclose(T[:3, 2], -away, atol=1e-9)
    # x, y in [-1, 1] and z in [0.1, 0.7], before normalising: an elevation of at least that of (1, 1, 0.1).
    assert away[2] >= 0.1 / np.sqrt(2.01) - 1e-9
    assert np.pi - abs(np.arctan2(away[1], away[0])) >= np.pi / 8


@given(seed=st.integers(0, 10_000), x=st.tuples(signs, signs), distance=st.tuples(st.floats(0.3, 1), st.floats(1, 2)))
@settings(deadline=None)
def test_every_range_of_the_arc_is_kept(seed: int, x: tuple, distance: tuple) -> None:
    cfg = with_arc(
        direction_x=tuple(sorted(x)), direction_y=(0.5, 1.0), direction_z=(0.2, 0.3), distance_m=distance,
        behind_robot_rad=0.0,
    )  # fmt: skip
    away = random_camera(cfg, np.random.default_rng(seed)).T_base_cam[:3, 3] - CENTRE
    assert distance[0] - 1e-9 <= np.linalg.norm(away) <= distance[1] + 1e-9
    # Scaled so that y has its extremes, x and z must have been possible.
    assert min(x) / (0.5 if min(x) < 0 else 1.0) - 1e-9 <= away[0] / away[1]
    assert away[0] / away[1] <= max(x) / (0.5 if max(x) > 0 else 1.0) + 1e-9
    assert 0.2 - 1e-9 <= away[2] / away[1] <= 0.6 + 1e-9


def test_directions_are_uniform_before_they_are_normalised() -> None:
    rng = np.random.default_rng(0)
    directions = np.array([random_direction(replace(CameraArcCfg(), behind_robot_rad=0.0), rng) for _ in range(4000)])
    # A cube's corners are nearer to its diagonals than a circle is: tan of the bearing says more than the bearing.
    reached = np.maximum(np.abs(directions[:, 0]), np.abs(directions[:, 1]))
    share = ((directions[:, 2] / reached) < 0.4).mean()
    # P(z < 0.4 m) with m the larger of |x|, |y|, of density 2 m, and z uniform on [0.1, 0.7].
    m = np.linspace(0, 1, 100_001)
    expected = np.trapezoid(2 * m * np.clip((0.4 * m - 0.1) / 0.6, 0, 1), m)
    assert share == pytest.approx(expected, abs=0.025)


def test_by_hand_a_camera_with_fixed_ranges_stands_where_they_say() -> None:
    cfg = with_arc(direction_x=(1.0, 1.0), direction_y=(0.0, 0.0), direction_z=(0.75, 0.75), distance_m=(2.0, 2.0))
    eye = random_camera(cfg, np.random.default_rng(0)).T_base_cam[:3, 3]
    np.testing.assert_allclose(eye - CENTRE, [1.6, 0.0, 1.2])


def test_an_arc_behind_the_robot_is_refused_with_its_settings() -> None:
    cfg = with_arc(direction_x=(-1.0, -0.9), direction_y=(-0.1, 0.1))
    with pytest.raises(ConfigError, match=r"direction_x \(-1.0, -0.9\).*behind_robot_rad 0.393"):
        random_camera(cfg, np.random.default_rng(0))


def test_a_camera_that_looks_past_the_cube_is_refused_and_one_that_sees_a_corner_is_not() -> None:
    lower, upper = CENTRE - 0.12, CENTRE + 0.12
    require_view(camera_at(1.0, 0.0, 0.6), lower, upper)
    require_view(PinholeCamera.looking_at((1.0, 0.0, 0.6), upper, 0.1, 20), lower, upper)
    with pytest.raises(ConfigError, match=r"camera at \(1.000, 0.000, 0.600\) m looks past"):
        require_view(PinholeCamera.looking_at((1.0, 0.0, 0.6), (1.5, 0.0, 0.6), 0.47, 20), lower, upper)


@given(seed=st.integers(0, 200))
@settings(max_examples=25, deadline=None)
def test_a_camera_inside_an_object_is_refused_with_its_name_and_one_outside_is_not(seed: int) -> None:
    rng = np.random.default_rng(seed)
    model = object_set("procedural", "train").sample(rng)
    T_base_object = transform_from(rotation_about_z(rng.uniform(0, 6)), [0.5, 0.1, 0.05])
    part = model.parts[rng.integers(len(model.parts))]
    weights = rng.dirichlet(np.ones(len(part.vertices)))
    inside = T_base_object[:3, :3] @ (weights @ part.vertices) + T_base_object[:3, 3]
    with pytest.raises(ConfigError, match=f"is inside the object '{model.name}'"):
        require_outside(camera_at(*inside), [(model, T_base_object)])
    highest = T_base_object[:3, :3] @ np.array([0, 0, model.bounds_m[1, 2] + 1e-3]) + T_base_object[:3, 3]
    require_outside(camera_at(*highest), [(model, T_base_object)])
