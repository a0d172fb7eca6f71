"""The page in the browser, without a browser: its nodes are what the scene is."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from tr_grasp import keys
from tr_grasp.configs import EnvCfg, ObjectsCfg, ObservationCfg, RandomisationCfg
from tr_grasp.errors import ConfigError
from tr_grasp.evaluation.browser_shapes import body_mesh, ground_mesh, octree_leaves
from tr_grasp.octree import OctreeSpec, octree_from_points
from tr_grasp.sensing import Body
from tr_grasp.sensing.look import GroundTexture

SPEC = OctreeSpec((0.0, 0.0, 0.0), 0.16, depth=4, leaf_capacity=32)


def test_a_leaf_stands_where_its_points_are_in_their_colour():
    points = np.array([[0.011, 0.022, 0.155]], np.float32)
    frame = octree_from_points(points, np.array([[0, 0, 1.0]]), np.array([[1.0, 0.5, 0.0]]), SPEC)
    centres, colours = octree_leaves(frame, SPEC)
    np.testing.assert_allclose(centres, [[0.015, 0.025, 0.155]], atol=1e-6)
    np.testing.assert_array_equal(colours, [[255, 128, 0]])


def test_every_face_keeps_its_colour():
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
    body = Body(corners, np.array([[0, 1, 2], [0, 2, 3]]), np.array([[1, 0, 0], [0, 0, 1]], float))
    mesh = body_mesh(body)
    np.testing.assert_array_equal(mesh.visual.vertex_colors[:, :3], np.repeat([[255, 0, 0], [0, 0, 255]], 3, axis=0))
    np.testing.assert_allclose(mesh.triangles[1], corners[[0, 2, 3]])


def test_the_table_is_laid_with_its_texture():
    image = np.zeros((4, 4, 3), np.float32)
    mesh = ground_mesh(GroundTexture(image, 0.5))
    assert np.ptp(mesh.visual.uv, axis=0).tolist() == [4.0, 4.0]
    assert mesh.visual.material.baseColorTexture.size == (4, 4)


@pytest.mark.sim
def test_the_page_has_the_scene_and_goes_back_in_time():
    pytest.importorskip("viser")
    from tr_grasp.envs import make_env
    from tr_grasp.evaluation.browser import BrowserView

    cfg = EnvCfg(
        objects=ObjectsCfg(count_range=(2, 2)),
        observation=ObservationCfg(stack_n=1),
        randomise=RandomisationCfg(ground_texture=True),
    )
    env, page = make_env(cfg, seed=1), BrowserView(port=18_080, step_s=0.0)
    try:
        state = env.reset()
        page(env, 0, None, state)
        action = torch.tensor([0.0, 0.0, -1.0, 0.0, 1.0])
        after = env.step(state.set(keys.ACTION, action))["next"]
        page(env, 1, action, after)
        nodes = {name for name in page.server.scene._handle_from_node_name if name.count("/") <= 2}
        links_n = env.task.view.object_indices.start
        wanted = {"/table", "/workspace", "/octree", "/camera", "/points", "/leaves", "/objects/0", "/objects/1"}
        assert wanted | {f"/robot/{i}" for i in range(links_n)} <= nodes
        hand = page._bodies[links_n - 1]
        low = hand.position[2]
        assert low == pytest.approx(env.task.view.poses()[links_n - 1, 2, 3], abs=1e-6)
        page.show(0)
        assert hand.position[2] > low + 0.02
        assert len(page.snapshots[1].leaves) == int((after[keys.OCTREE].codes >= 0).sum())
        assert page.address.startswith("http://localhost:")
    finally:
        page.close()
        env.close()


def test_a_missing_package_is_named_with_its_cure(monkeypatch):
    from tr_grasp.evaluation.browser import BrowserView

    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(ConfigError, match=r"pip install 'tr-grasp\[viewer\]'"):
        BrowserView()


def test_the_slider_before_the_first_episode_does_nothing():
    from tr_grasp.evaluation.browser import BrowserView

    assert BrowserView._go_back(SimpleNamespace(snapshots=[])) is None
