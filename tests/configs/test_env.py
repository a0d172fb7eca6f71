"""What the settings of the world refuse."""

from __future__ import annotations

import re

import pytest

from tr_grasp.configs import ActionCfg, EnvCfg, RandomisationCfg, TrainCfg
from tr_grasp.configs.build import build, leaf_types
from tr_grasp.errors import ConfigError

RANGES = [
    path
    for path, hint in leaf_types(TrainCfg)
    if path.startswith("env.") and str(hint).replace(" ", "") in ("tuple[float,float]", "tuple[int,int]")
]


def changed(path: str, value: object) -> TrainCfg:
    for name in reversed(path.split(".")):
        value = {name: value}
    return build(TrainCfg(), value)


def test_all_ranges_of_the_world_are_found() -> None:
    assert {"env.objects.count_range", "env.camera.arc.distance_m", "env.action.latency_s"} <= set(RANGES)
    assert len(RANGES) >= 11


@pytest.mark.parametrize("path", RANGES)
def test_a_range_with_low_above_high_is_refused_by_name(path: str) -> None:
    value = [3, 2] if path.endswith("count_range") else [0.3, 0.2]
    with pytest.raises(ConfigError, match=re.escape(path.removeprefix("env."))):
        changed(path, value)


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("env.camera.arc.distance_m", [0.0, 1.0], "distance_m must be positive"),
        ("env.camera.arc.direction_z", [-0.1, 0.7], "0 <= low <= high"),
        ("env.camera.arc.behind_robot_rad", 4.0, r"\[0, pi\)"),
        ("env.camera.stereo.baseline_m", 0.0, "baseline_m must be positive"),
        ("env.camera.stereo.disparity_noise_px", -0.1, "must not be negative"),
        ("env.camera.stereo.fov_rad", 3.2, r"fov_rad must be in \(0, pi\)"),
        ("env.action.latency_s", [-0.1, 0.1], "0 <= low <= high"),
        ("env.gravity_sigma_mps2", -0.1, r"\[0, 2\]"),
        ("env.initial_joint_noise_rad", -0.1, "must not be negative"),
        ("env.objects.spread", 1.2, r"\(0, 1\]"),
        ("env.objects.count_range", [4, 9], "high <= 8"),
        ("env.randomise.depth_noise", "stero", "gaussian"),
    ],
)
def test_a_value_that_makes_no_sense_is_refused(path: str, value: object, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        changed(path, value)


def test_an_arc_straight_above_is_refused() -> None:
    with pytest.raises(ConfigError, match="must leave the vertical"):
        build(TrainCfg(), {"env": {"camera": {"arc": {"direction_x": [0.0, 0.0], "direction_y": [0.0, 0.0]}}}})


def test_a_latency_beyond_the_control_period_is_refused_where_it_is_used() -> None:
    slow = ActionCfg(latency_s=(0.0, 0.3))
    EnvCfg(action=slow)
    with pytest.raises(ConfigError, match=r"latency_s must not exceed the control period of 0.25 s, got \(0.0, 0.3\)"):
        EnvCfg(action=slow, randomise=RandomisationCfg(latency=True))
