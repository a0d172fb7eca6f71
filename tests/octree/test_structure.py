from __future__ import annotations

import itertools
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from tests.octree.clouds import SPEC, random_frames
from tr_grasp.errors import ConfigError
from tr_grasp.octree import Octree, OctreeFrame, OctreeSpec, octree_from_points


def cell_of(code: int, depth: int) -> tuple[int, int, int]:
    """Cell coordinates of a Morton code, bit by bit."""
    x = y = z = 0
    for bit in reversed(range(depth)):
        triple = code >> 3 * bit & 7
        x, y, z = 2 * x + (triple >> 2), 2 * y + (triple >> 1 & 1), 2 * z + (triple & 1)
    return x, y, z


def expected_nodes(frames: OctreeFrame, leaf_depth: int, depth: int, node_set: str) -> list[tuple[int, int]]:
    """(sample, code) of the nodes of a depth, from the definition."""
    leaves = [(b, c) for b, codes in enumerate(frames.codes.tolist()) for c in codes if c >= 0]
    occupied = {(b, c >> 3 * (leaf_depth - depth)) for b, c in leaves}
    if node_set == "occupied":
        return sorted(occupied)
    if depth <= 2:
        return list(itertools.product(range(len(frames)), range(8**depth)))
    return sorted({(b, (c & ~7) + child) for b, c in occupied for child in range(8)})


@pytest.mark.parametrize("node_set", ["occupied", "siblings"])
@pytest.mark.parametrize("leaf_depth", [3, 4, 5, 6])
def test_levels_hold_the_nodes_of_the_definition(leaf_depth: int, node_set: str) -> None:
    spec = OctreeSpec(SPEC.origin_m, SPEC.side_m, leaf_depth)
    frames = random_frames(3, n=60, spec=spec)
    octree = Octree(frames, spec.depth, node_set)
    for depth in range(1, leaf_depth + 1):
        level = octree.level(depth)
        nodes = list(zip(level.samples.tolist(), level.codes.tolist(), strict=True))
        assert nodes == expected_nodes(frames, leaf_depth, depth, node_set)
        assert level.cells.tolist() == [list(cell_of(code, depth)) for _, code in nodes]


@pytest.mark.parametrize("node_set", ["occupied", "siblings"])
def test_tables_point_to_parents_children_and_neighbours(node_set: str) -> None:
    octree = Octree(random_frames(2, n=120), SPEC.depth, node_set)
    fine, coarse = octree.level(4), octree.level(3)
    row_of = {
        level.depth: {
            key: row
            for row, key in enumerate(zip(level.samples.tolist(), map(tuple, level.cells.tolist()), strict=True))
        }
        for level in (fine, coarse)
    }
    parents, neighbours = octree.parents(4).tolist(), fine.neighbours.tolist()
    for (sample, cell), row in row_of[4].items():
        assert parents[row] == row_of[3][sample, tuple(c // 2 for c in cell)]
        around = [tuple(map(sum, zip(cell, step, strict=True))) for step in itertools.product((-1, 0, 1), repeat=3)]
        assert neighbours[row] == [row_of[4].get((sample, near), fine.nodes_n) for near in around]
    children = octree.children(3).tolist()
    for (sample, cell), row in row_of[3].items():
        inside = [
            tuple(2 * c + s for c, s in zip(cell, step, strict=True)) for step in itertools.product((0, 1), repeat=3)
        ]
        assert children[row] == [row_of[4].get((sample, child), fine.nodes_n) for child in inside]


def test_neighbourhood_is_symmetric() -> None:
    table = Octree(random_frames(3), SPEC.depth).level(4).neighbours.long()
    present = (table < len(table)).nonzero()
    node, tap = present.unbind(1)
    assert torch.equal(table[table[node, tap], 26 - tap], node)


def test_frames_in_a_batch_do_not_touch_each_other() -> None:
    frames = random_frames(4)
    merged = Octree(frames, SPEC.depth)
    start = 0
    for sample in range(4):
        alone = Octree(frames[sample : sample + 1], SPEC.depth)
        rows = slice(start, start + alone.level(4).nodes_n)
        mine = merged.level(4).neighbours[rows]
        local = torch.where(mine == merged.level(4).nodes_n, alone.level(4).nodes_n, mine - start)
        assert torch.equal(local, alone.level(4).neighbours)
        assert torch.equal(merged.leaf_features()[rows], alone.leaf_features())
        start = rows.stop


@pytest.mark.parametrize("node_set", ["occupied", "siblings"])
def test_the_order_of_slots_and_the_place_of_padding_do_not_matter(node_set: str) -> None:
    frames = random_frames(3)
    order = torch.randperm(SPEC.leaf_capacity)
    shuffled = OctreeFrame(codes=frames.codes[:, order], features=frames.features[:, order], batch_size=[3])
    a, b = (Octree(f, SPEC.depth, node_set) for f in (frames, shuffled))
    assert torch.equal(a.level(4).keys, b.level(4).keys)
    assert torch.equal(a.node_features(), b.node_features())


def test_the_mean_point_is_recovered_where_it_lies_along_the_normal() -> None:
    points = np.array(SPEC.origin_m) + np.array([[0.031, 0.07, 0.11], [0.2, 0.14, 0.02]])
    centres = np.array(SPEC.origin_m) + (np.floor((points - SPEC.origin_m) / SPEC.leaf_m) + 0.5) * SPEC.leaf_m
    normals = (points - centres) / np.linalg.norm(points - centres, axis=1, keepdims=True)
    normals[1] *= -1
    octree = Octree(octree_from_points(points, normals, np.zeros((2, 3)), SPEC)[None], SPEC.depth)
    recovered = octree.leaf_points().numpy() * SPEC.side_m / 2 + SPEC.centre_m
    np.testing.assert_allclose(recovered, points, atol=1e-5)


def test_padding_puts_each_sample_in_its_own_row() -> None:
    frames = random_frames(3)
    frames.codes[1] = -1
    level = Octree(frames, SPEC.depth).level(3)
    features = torch.randn(level.nodes_n, 2)
    padded = level.pad(features)
    assert padded.shape == (3, int(torch.bincount(level.samples).max()), 2)
    for sample, row in enumerate(padded):
        mine = features[level.samples == sample]
        assert torch.equal(row[: len(mine)], mine)
        assert not row[len(mine) :].any()


def test_empty_siblings_carry_zeros() -> None:
    frames = random_frames(2)
    octree = Octree(frames, SPEC.depth, "siblings")
    features = octree.node_features()
    assert features.shape == (octree.level(4).nodes_n, 7)
    filled = features.abs().sum(1) > 0
    assert int(filled.sum()) == int(frames.leaves_n.sum())
    assert torch.equal(octree.level(4).keys[filled], octree.leaves.keys)


def test_a_batch_of_empty_frames_has_no_occupied_nodes() -> None:
    frames = OctreeFrame.unoccupied(SPEC, (2,))
    assert Octree(frames, SPEC.depth).level(3).nodes_n == 0
    assert Octree(frames, SPEC.depth, "siblings").level(2).nodes_n == 128


def test_unknown_node_set_and_wrong_batch_are_refused() -> None:
    frames = random_frames(4)
    with pytest.raises(ConfigError, match="did you mean 'occupied'"):
        Octree(frames, SPEC.depth, "ocupied")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"\(B,\)"):
        Octree(frames.reshape(2, 2), SPEC.depth)


@pytest.mark.parametrize("backend", ["sparse", "dense"])
def test_tensors_that_do_not_belong_together_are_refused(backend: str) -> None:
    frames = random_frames(2)
    codes, features = frames.codes, frames.features
    for wrong_codes, wrong_features, words in (
        (codes, features[:, :5], "codes' shape"),
        (codes, features[0], "codes' shape"),
        (codes.float(), features, "must be integers"),
        (codes, features.to("meta"), "one device"),
    ):
        with pytest.raises(ValueError, match=words):
            Octree(SimpleNamespace(codes=wrong_codes, features=wrong_features), 4, backend=backend)
    with pytest.raises(ValueError, match="of another depth"):
        Octree(frames, 3, backend=backend)
