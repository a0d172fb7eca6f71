import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tr_grasp.configs import ObjectsCfg, WorkspaceCfg
from tr_grasp.envs.placement import drop_poses, inside
from tr_grasp.errors import ConfigError

SPACE = WorkspaceCfg()


@given(seed=st.integers(0, 5000), count=st.integers(1, 6))
def test_scattered_objects_start_over_the_workspace_above_the_table(seed, count):
    diagonals = np.full(count, 0.12)
    poses = drop_poses(diagonals, ObjectsCfg(), SPACE, np.random.default_rng(seed))
    positions = np.array([position for position, _ in poses])
    assert inside(positions, SPACE, -0.02).all()
    assert (positions[:, 2] >= 0.06).all()
    np.testing.assert_allclose([np.linalg.norm(q) for _, q in poses], 1.0)


@given(seed=st.integers(0, 5000))
def test_piled_objects_start_above_each_other(seed):
    diagonals = np.array([0.10, 0.15, 0.12, 0.08])
    poses = drop_poses(diagonals, ObjectsCfg(arrangement="pile"), SPACE, np.random.default_rng(seed))
    heights = np.array([position[2] for position, _ in poses])
    assert (np.diff(heights) > 0.05).all()
    assert max(np.linalg.norm(position[:2] - [0.5, 0]) for position, _ in poses) < 0.04


def test_a_point_under_the_table_or_outside_the_margin_is_out():
    points = np.array([[0.5, 0, 0.1], [0.66, 0, 0.1], [0.68, 0, 0.1], [0.5, 0, -0.2]])
    np.testing.assert_array_equal(inside(points, SPACE, 0.05), [True, True, False, False])


def test_too_many_objects_for_the_workspace_are_refused_with_the_ways_out():
    with pytest.raises(ConfigError, match=r"6 objects with a mean diagonal of 0.150 m do not fit.*objects.count_range"):
        drop_poses(np.full(6, 0.15), ObjectsCfg(), WorkspaceCfg(side_m=0.08), np.random.default_rng(0))


def test_upright_objects_turn_about_the_vertical_alone():
    poses = drop_poses(np.full(4, 0.1), ObjectsCfg(orientation="upright_yaw"), SPACE, np.random.default_rng(0))
    assert all(np.allclose(q[1:3], 0) for _, q in poses)


def test_a_mixed_arrangement_is_a_pile_about_every_second_time():
    def is_pile(seed: int) -> bool:
        poses = drop_poses(np.full(4, 0.1), ObjectsCfg(arrangement="mixed"), SPACE, np.random.default_rng(seed))
        return bool(poses[-1][0][2] > 0.2)

    assert 35 < sum(is_pile(seed) for seed in range(100)) < 65
