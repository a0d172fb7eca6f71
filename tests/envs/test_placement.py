import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from tr_grasp.configs import ObjectsCfg, WorkspaceCfg
from tr_grasp.envs.placement import drop_poses, inside

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
