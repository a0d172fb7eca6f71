import numpy as np
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from tr_grasp.geometry import matrix_from_wxyz, random_wxyz, transform_from
from tr_grasp.sensing import Body, PinholeCamera, RaycastScene

BALL = trimesh.creation.icosphere(4, 0.05)
BLOCK = trimesh.creation.box((0.1, 0.2, 0.3))
CAMERA = PinholeCamera.looking_at((1.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.4, 25)


def body(mesh: trimesh.Trimesh, colour=(0.1, 0.2, 0.3)) -> Body:
    return Body.uniform(mesh.vertices, mesh.faces, colour)


def test_a_ball_is_seen_at_its_distance_in_its_colour():
    image = RaycastScene([body(BALL)]).capture(CAMERA, np.eye(4)[None])
    np.testing.assert_allclose(image.depth[12, 12], 0.95, atol=1e-3)
    np.testing.assert_allclose(image.colour[12, 12], [0.1, 0.2, 0.3], atol=1e-6)
    assert np.isinf(image.depth[0, 0])


def test_the_nearer_body_hides_the_farther_one():
    scene = RaycastScene([body(BALL, (1, 0, 0)), body(BALL, (0, 1, 0))])
    poses = np.stack([transform_from(np.eye(3), [-0.3, 0, 0]), transform_from(np.eye(3), [0.3, 0, 0])])
    np.testing.assert_allclose(scene.capture(CAMERA, poses).colour[12, 12], [0, 1, 0])


def test_a_body_left_out_is_not_hit():
    scene = RaycastScene([body(BALL), body(BLOCK)])
    hits = scene.cast(CAMERA.rays_base, np.stack([np.eye(4)] * 2), [0])
    assert set(np.unique(hits.body)) == {-1, 0}


@settings(max_examples=25)
@given(seed=st.integers(0, 10_000))
def test_moving_a_body_is_moving_the_rays_the_other_way(seed):
    rng = np.random.default_rng(seed)
    T = transform_from(matrix_from_wxyz(random_wxyz(rng)), rng.uniform(-0.05, 0.05, 3))
    hits = RaycastScene([body(BLOCK)]).cast(CAMERA.rays_base, T[None])
    moved = trimesh.Trimesh(BLOCK.vertices @ T[:3, :3].T + T[:3, 3], BLOCK.faces, process=False)
    expected = RaycastScene([body(moved)]).cast(CAMERA.rays_base, np.eye(4)[None])
    hit = np.isfinite(expected.distance) & np.isfinite(hits.distance)
    assert (np.isfinite(expected.distance) != np.isfinite(hits.distance)).mean() < 0.01
    np.testing.assert_allclose(hits.distance[hit], expected.distance[hit], atol=1e-4)


@settings(max_examples=25)
@given(seed=st.integers(0, 10_000))
def test_leaving_out_what_cannot_be_seen_changes_no_picture(seed):
    rng = np.random.default_rng(seed)
    scene = RaycastScene([body(BALL, rng.uniform(0, 1, 3)) for _ in range(6)])
    poses = np.stack([transform_from(np.eye(3), rng.uniform([-1, -1, -1], [1.5, 1, 1])) for _ in range(6)])
    whole = scene.cast(CAMERA.rays_base, poses)
    image = scene.capture(CAMERA, poses)
    np.testing.assert_allclose(image.depth.ravel(), whole.distance, atol=1e-5)
    np.testing.assert_allclose(image.colour.reshape(-1, 3), whole.colours, atol=1e-6)
