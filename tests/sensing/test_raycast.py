import numpy as np
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from tr_grasp.geometry import matrix_from_wxyz, random_wxyz, transform_from
from tr_grasp.sensing import Body, PinholeCamera, RaycastCamera, RaycastScene
from tr_grasp.sensing.raycast import BACKGROUND

BALL = trimesh.creation.icosphere(4, 0.05)
BLOCK = trimesh.creation.box((0.1, 0.2, 0.3))
CAMERA = PinholeCamera.looking_at((1.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.4, 25)


def body(mesh: trimesh.Trimesh, colour=(0.1, 0.2, 0.3)) -> Body:
    return Body.uniform(mesh.vertices, mesh.faces, colour)


def test_a_ball_is_seen_at_its_distance_in_its_colour():
    image = RaycastCamera(RaycastScene([body(BALL)]), CAMERA).capture(np.eye(4)[None])
    np.testing.assert_allclose(image.depth[12, 12], 0.95, atol=1e-3)
    np.testing.assert_allclose(image.colour[12, 12], [0.1, 0.2, 0.3], atol=1e-6)
    assert np.isinf(image.depth[0, 0])


def test_the_nearer_body_hides_the_farther_one():
    scene = RaycastScene([body(BALL, (1, 0, 0)), body(BALL, (0, 1, 0))])
    poses = np.stack([transform_from(np.eye(3), [-0.3, 0, 0]), transform_from(np.eye(3), [0.3, 0, 0])])
    np.testing.assert_allclose(RaycastCamera(scene, CAMERA).capture(poses).colour[12, 12], [0, 1, 0])


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


def test_a_body_that_never_moves_is_where_it_was_given():
    wall = Body.uniform(BLOCK.vertices - np.array([0.5, 0, 0]), BLOCK.faces, (0, 0, 1))
    scene = RaycastScene([body(BALL, (1, 0, 0))], still=[wall])
    aside = transform_from(np.eye(3), [0, 0.15, 0])[None]
    hits = scene.cast(CAMERA.rays_base, aside)
    assert set(np.unique(hits.body)) == {-1, 0, 1}
    np.testing.assert_allclose(RaycastCamera(scene, CAMERA).capture(aside).depth[12, 12], 1.45, atol=1e-4)


@settings(max_examples=25)
@given(seed=st.integers(0, 10_000))
def test_casting_only_where_bodies_may_be_seen_changes_no_picture(seed):
    rng = np.random.default_rng(seed)
    scene = RaycastScene(
        [body(BALL if rng.random() < 0.5 else BLOCK, rng.uniform(0, 1, 3)) for _ in range(6)], still=[body(BLOCK)]
    )
    poses = np.stack(
        [transform_from(matrix_from_wxyz(random_wxyz(rng)), rng.uniform([-1, -1, -1], [1.5, 1, 1])) for _ in range(6)]
    )
    whole = scene.cast(CAMERA.rays_base, poses)
    image = RaycastCamera(scene, CAMERA).capture(poses)
    np.testing.assert_array_equal(image.depth.ravel(), whole.distance)
    np.testing.assert_array_equal(image.colour.reshape(-1, 3), whole.colours)


def test_where_no_pixel_is_wanted_only_what_stays_is_seen():
    scene, wanted = RaycastScene([body(BALL, (1, 0, 0))]), np.zeros((25, 25), bool)
    wanted[:, :12] = True
    colour = RaycastCamera(scene, CAMERA, wanted).capture(np.eye(4)[None]).colour
    np.testing.assert_allclose(colour[12, 11], [1, 0, 0])
    np.testing.assert_allclose(colour[12, 12], BACKGROUND)
