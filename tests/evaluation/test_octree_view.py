from __future__ import annotations

import numpy as np
import pytest
import torch

from tr_grasp.evaluation.octree_view import BACKGROUND, FACE_BRIGHTNESS, NO_COLOUR, Gripper, OctreeView
from tr_grasp.octree import OctreeFrame, OctreeSpec
from tr_grasp.octree.morton import encode_cells

SPEC = OctreeSpec((0.38, -0.12, 0.0), 0.24, depth=3, leaf_capacity=128)
FORWARD = np.array([-0.6, 0.62, -0.4])
RED = (0.9, 0.1, 0.1)


def frame_of(cells: np.ndarray, colours: np.ndarray, spec: OctreeSpec = SPEC) -> OctreeFrame:
    frame = OctreeFrame.unoccupied(spec)
    codes = encode_cells(cells, spec.depth)
    order = np.argsort(codes)
    frame.codes[: len(cells)] = torch.from_numpy(codes[order].astype(np.int16))
    if spec.colour:
        frame.features[: len(cells), 4:] = torch.from_numpy(colours[order]).half()
    return frame


def centre_of(cell: np.ndarray, spec: OctreeSpec = SPEC) -> np.ndarray:
    return np.array(spec.origin_m) + (cell + 0.5) * spec.leaf_m


def pixel(view: OctreeView, picture: np.ndarray, point: np.ndarray) -> np.ndarray:
    x, y = view.project(point).astype(int)
    return picture[y, x]


def seen(point: np.ndarray, cells: np.ndarray) -> tuple[int, int]:
    """Leaf and axis of the face that a viewer sees in the direction of ``point``: a slab test against every leaf."""
    forward = FORWARD / np.linalg.norm(FORWARD)
    start = point - forward  # one metre before it
    low = np.array(SPEC.origin_m) + cells * SPEC.leaf_m
    hits = np.sort((np.stack([low, low + SPEC.leaf_m]) - start) / forward, axis=0)
    enter, leave = hits[0].max(1), hits[1].min(1)
    leaf = int(np.where(enter < leave, enter, np.inf).argmin())
    return leaf, int(hits[0, leaf].argmax())


def test_every_face_is_hidden_or_shown_as_a_ray_would_see_it() -> None:
    rng = np.random.default_rng(0)
    cells = rng.permutation(np.indices((8, 8, 8)).reshape(3, -1).T)[:120]
    colours = rng.uniform(0.2, 1, (120, 3)).astype(np.float32)
    view = OctreeView(SPEC, FORWARD, size_px=800)
    picture = view.draw(frame_of(cells, colours))
    around = 0.08 * SPEC.leaf_m * np.concatenate([np.eye(3), -np.eye(3)])
    shown = hidden = 0
    for leaf, cell in enumerate(cells):
        for axis in range(3):
            point = centre_of(cell) - 0.5 * SPEC.leaf_m * np.sign(FORWARD[axis]) * np.eye(3)[axis]
            face = seen(point, cells)
            if any(seen(point + step, cells) != face for step in around):
                continue  # a pixel near an edge mixes two faces
            expected = 255 * colours[face[0]] * FACE_BRIGHTNESS[face[1]]
            assert pixel(view, picture, point) == pytest.approx(expected, abs=2)
            is_shown = face == (leaf, axis)
            shown, hidden = shown + is_shown, hidden + (not is_shown)
    assert min(shown, hidden) > 50


def test_one_red_leaf_by_hand() -> None:
    cell = np.array([[3, 4, 2]])
    view = OctreeView(SPEC, FORWARD)
    picture = view.draw(frame_of(cell, np.array([RED])))
    top = centre_of(cell[0]) + np.array([0, 0, SPEC.leaf_m / 2])
    assert pixel(view, picture, top) == pytest.approx(255 * np.array(RED), abs=2)
    front = centre_of(cell[0]) + np.array([SPEC.leaf_m / 2, 0, 0])
    assert pixel(view, picture, front) == pytest.approx(255 * np.array(RED) * 0.62, abs=2)
    assert tuple(picture[2, 2]) == BACKGROUND


def test_up_is_up_and_left_is_left() -> None:
    """Looking along +y, x points to the right."""
    view = OctreeView(SPEC, np.array([0.0, 1.0, -0.2]))
    middle = np.array(SPEC.centre_m)
    x, y = view.project(np.stack([middle, middle + np.array([0.1, 0, 0]), middle + np.array([0, 0, 0.1])])).T
    assert x[1] > x[0] == pytest.approx(x[2])
    assert y[2] < y[0] == pytest.approx(y[1])
    assert (x[0], y[0]) == pytest.approx((160, 160))


def test_the_whole_cube_fits() -> None:
    view = OctreeView(SPEC, FORWARD, size_px=200)
    corners = np.array(SPEC.origin_m) + np.indices((2, 2, 2)).reshape(3, -1).T * SPEC.side_m
    pixels = view.project(corners)
    assert pixels.min() >= 0
    assert pixels.max() <= 200


def test_no_leaf_draws_only_the_cube() -> None:
    picture = OctreeView(SPEC, FORWARD).draw(OctreeFrame.unoccupied(SPEC))
    assert picture.shape == (320, 320, 3)
    assert (picture == BACKGROUND).all(-1).mean() > 0.95
    assert not (picture == BACKGROUND).all()


def test_an_octree_without_colour_is_grey() -> None:
    spec = OctreeSpec(SPEC.origin_m, SPEC.side_m, depth=3, leaf_capacity=8, colour=False)
    view = OctreeView(spec, FORWARD)
    cell = np.array([[3, 4, 2]])
    picture = view.draw(frame_of(cell, np.zeros((1, 3)), spec))
    top = centre_of(cell[0], spec) + np.array([0, 0, spec.leaf_m / 2])
    assert pixel(view, picture, top) == pytest.approx(255 * np.array(NO_COLOUR), abs=2)


def test_an_open_gripper_is_drawn_wider_than_a_closed_one() -> None:
    view = OctreeView(SPEC, FORWARD)
    middle, axis = np.array(SPEC.centre_m), np.array([0.0, 1.0, 0.0])
    finger = middle + 0.044 * axis + [0, 0, 0.02]
    opened = view.draw(OctreeFrame.unoccupied(SPEC), Gripper(middle, axis, 1.0))
    closed = view.draw(OctreeFrame.unoccupied(SPEC), Gripper(middle, axis, -1.0))
    assert pixel(view, opened, finger).mean() < 80
    assert pixel(view, closed, finger).mean() > 200
