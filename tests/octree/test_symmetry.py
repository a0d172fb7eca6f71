from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor

from tests.octree.clouds import SPEC, random_cloud, random_frames
from tr_grasp.octree import (
    Octree,
    OctreeFrame,
    OctreeSpec,
    augment,
    octree_conv,
    octree_from_points,
    octree_to_voxels,
    turn_action,
    turn_frames,
    turn_proprio,
    turn_target,
)
from tr_grasp.octree.symmetry import ELEMENTS_N, compose, inverse, random_elements, rotations

QUARTER_TURN, MIRROR = 1, 4


def random_proprio(n: int) -> Tensor:
    """Tools in the cube, in any orientation."""
    q, _ = torch.linalg.qr(torch.randn(n, 3, 3))
    q = q * torch.linalg.det(q)[:, None, None]
    position = torch.tensor(SPEC.centre_m) + (torch.rand(n, 3) - 0.5) * SPEC.side_m
    return torch.cat([torch.rand(n, 1) * 2 - 1, position, q[:, :, 0], q[:, :, 1]], dim=1)


def ordered(frames: OctreeFrame) -> tuple[Tensor, Tensor]:
    """Codes ascending in each frame, and the features in that order."""
    order = frames.codes.argsort(dim=1, stable=True)
    return frames.codes.gather(1, order), frames.features.gather(1, order[..., None].expand_as(frames.features))


ALL = torch.arange(ELEMENTS_N)
FIRST, THEN = (pairs.flatten() for pairs in torch.meshgrid(ALL, ALL, indexing="ij"))


def test_composition_is_the_product_of_the_matrices() -> None:
    assert torch.equal(rotations(compose(FIRST, THEN)), rotations(THEN) @ rotations(FIRST))


def test_every_element_has_an_inverse_and_zero_is_the_identity() -> None:
    assert not compose(ALL, inverse(ALL)).any()
    assert not compose(inverse(ALL), ALL).any()
    assert torch.equal(rotations(torch.tensor(0)), torch.eye(2))


def test_frames_proprioception_and_actions_obey_the_composition_table() -> None:
    n = len(FIRST)
    sample = (random_frames(4).repeat(n // 4), random_proprio(n), torch.rand(n, 5) * 2 - 1)
    once = augment(compose(FIRST, THEN), *sample, SPEC)
    twice = augment(THEN, *augment(FIRST, *sample, SPEC), SPEC)
    assert torch.equal(once[0].codes, twice[0].codes)
    assert torch.equal(once[0].features, twice[0].features)
    torch.testing.assert_close(once[1], twice[1])
    assert torch.equal(once[2], twice[2])


@given(seed=st.integers(0, 1000), element=st.integers(0, 7), depth=st.sampled_from([3, 4, 5, 6]))
def test_turning_the_frame_is_building_from_turned_points(seed: int, element: int, depth: int) -> None:
    spec = OctreeSpec(SPEC.origin_m, SPEC.side_m, depth)
    cloud = random_cloud(seed, 200, spec)
    matrix = np.eye(3)
    matrix[:2, :2] = rotations(torch.tensor(element)).numpy()
    centre = np.array(spec.centre_m)
    turned_points = (cloud.points - centre) @ matrix.T + centre
    expected = octree_from_points(turned_points, cloud.normals @ matrix.T, cloud.colours, spec)
    turned = turn_frames(torch.tensor([element]), octree_from_points(*cloud, spec)[None], spec)
    codes, features = ordered(turned)
    expected_codes, expected_features = ordered(expected[None])
    assert torch.equal(codes, expected_codes)
    torch.testing.assert_close(features, expected_features, rtol=0, atol=2e-3)


@given(element=st.integers(0, 7))
def test_the_tool_turns_like_a_rigid_body_and_stays_one(element: int) -> None:
    proprio = random_proprio(5)
    turned = turn_proprio(torch.full((5,), element), proprio, SPEC)
    matrix = torch.eye(3)
    matrix[:2, :2] = rotations(torch.tensor(element))
    centre = torch.tensor(SPEC.centre_m)
    torch.testing.assert_close(turned[:, 1:4], (proprio[:, 1:4] - centre) @ matrix.T + centre)
    assert torch.equal(turned[:, 0], proprio[:, 0])
    columns, before = turned[:, 4:].view(5, 2, 3), proprio[:, 4:].view(5, 2, 3)
    approach = torch.linalg.cross(columns[:, 0], columns[:, 1])
    torch.testing.assert_close(approach, torch.linalg.cross(before[:, 0], before[:, 1]) @ matrix.T)
    torch.testing.assert_close(columns[:, 0], before[:, 0] @ matrix.T)
    # The fingers lie on the same line, maybe with their names exchanged.
    sign = 1.0 if element < 4 else -1.0
    torch.testing.assert_close(columns[:, 1], sign * before[:, 1] @ matrix.T)


@given(element=st.integers(0, 7), yaw=st.floats(-3, 3), dphi=st.floats(-1, 1))
def test_acting_then_turning_is_turning_then_acting(element: int, yaw: float, dphi: float) -> None:
    """A tool that points down, moved by an action: position by dx, dy, dz, yaw by dphi about its own approach axis."""

    def act(proprio: Tensor, action: Tensor) -> Tensor:
        x, y = proprio[4:7], proprio[7:10]
        c, s = torch.cos(action[3]), torch.sin(action[3])
        return torch.cat([action[4:], proprio[1:4] + 0.05 * action[:3], c * x + s * y, -s * x + c * y])

    c, s = math.cos(yaw), math.sin(yaw)
    proprio = torch.tensor([1.0, 0.45, 0.03, 0.1, c, s, 0.0, s, -c, 0.0])
    action = torch.tensor([0.3, -0.8, 0.5, dphi, -1.0])
    element_1 = torch.tensor([element])
    turned_after = turn_proprio(element_1, act(proprio, action)[None], SPEC)[0]
    turned_before = act(turn_proprio(element_1, proprio[None], SPEC)[0], turn_action(element_1, action[None])[0])
    torch.testing.assert_close(turned_after, turned_before, atol=1e-5, rtol=0)


def test_a_quarter_turn_worked_by_hand() -> None:
    element = torch.tensor([QUARTER_TURN])
    action = torch.tensor([[1.0, 0.0, 0.5, 0.25, -1.0]])
    assert turn_action(element, action).tolist() == [[0.0, 1.0, 0.5, 0.25, -1.0]]
    proprio = torch.tensor([[1.0, 0.6, 0.0, 0.2, 1.0, 0.0, 0.0, 0.0, -1.0, 0.0]])
    expected = torch.tensor([[1.0, 0.5, 0.1, 0.2, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0]])
    torch.testing.assert_close(turn_proprio(element, proprio, SPEC), expected)


def test_a_mirrored_grasp_lies_on_the_other_side_and_turns_the_other_way() -> None:
    target = torch.tensor([[0.02, 0.03, -0.1, 0.6, 0.8, 1.0]])
    mirrored = turn_target(torch.tensor([4]), target)
    torch.testing.assert_close(mirrored, torch.tensor([[0.02, -0.03, -0.1, 0.6, -0.8, 1.0]]))
    quarter = turn_target(torch.tensor([1]), target)
    torch.testing.assert_close(quarter, torch.tensor([[-0.03, 0.02, -0.1, 0.6, 0.8, 1.0]]))


def test_a_mirror_worked_by_hand() -> None:
    element = torch.tensor([MIRROR])
    assert turn_action(element, torch.tensor([[1.0, 1.0, 0.5, 0.25, -1.0]])).tolist() == [[1.0, -1.0, 0.5, -0.25, -1.0]]
    proprio = torch.tensor([[1.0, 0.6, 0.1, 0.2, 0.6, 0.8, 0.0, 0.8, -0.6, 0.0]])
    expected = torch.tensor([[1.0, 0.6, -0.1, 0.2, 0.6, -0.8, 0.0, -0.8, -0.6, 0.0]])
    torch.testing.assert_close(turn_proprio(element, proprio, SPEC), expected)
    corner = random_frames(1)
    corner.codes[0] = -1
    corner.codes[0, 0] = 0  # the cell with the smallest x, y, z goes to the largest y: bits 010 at every depth
    assert turn_frames(element, corner, SPEC).codes[0, :2].tolist() == [0b010_010_010_010, -1]


def test_every_sample_of_a_stack_is_turned_by_its_own_element() -> None:
    frames, proprio = random_frames(6).reshape(2, 3), random_proprio(6).view(2, 3, 10)
    elements = torch.tensor([3, 6])
    turned_frames, turned_proprio = turn_frames(elements, frames, SPEC), turn_proprio(elements, proprio, SPEC)
    assert turned_frames.batch_size == (2, 3)
    for sample in range(2):
        element = elements[sample].expand(3)
        alone = turn_frames(element, frames[sample], SPEC)
        assert torch.equal(turned_frames.codes[sample], alone.codes)
        assert torch.equal(turned_frames.features[sample], alone.features)
        assert torch.equal(turned_proprio[sample], turn_proprio(element, proprio[sample], SPEC))


@pytest.mark.parametrize("element", range(ELEMENTS_N))
def test_convolving_then_turning_is_turning_then_convolving_with_a_turned_kernel(element: int) -> None:
    frames = random_frames(2)
    turned = turn_frames(torch.tensor([element, element]), frames, SPEC)
    before, after = Octree(frames, SPEC.depth), Octree(turned, SPEC.depth)
    weight = torch.randn(27, 1, 2)
    steps = torch.cartesian_prod(*[torch.arange(-1, 2)] * 3)
    matrix = torch.eye(3, dtype=torch.int64)
    matrix[:2, :2] = rotations(torch.tensor(element)).long()
    reads = (steps @ matrix.T + 1) @ torch.tensor([9, 3, 1])  # the tap to which each tap goes
    turned_weight = torch.empty_like(weight).index_copy(0, reads, weight)
    # The distance of a leaf stays while it moves, so it serves as a feature that must not be turned itself.
    a = octree_conv(before.leaf_features()[:, 3:4], weight, before, 4)
    b = octree_conv(after.leaf_features()[:, 3:4], turned_weight, after, 4)
    centred = before.leaves.cells * 2 - (SPEC.cells_n - 1)
    moved = (centred @ matrix.T + SPEC.cells_n - 1) // 2
    x, y, z = moved.unbind(1)
    grid = octree_to_voxels(b, after, 4)
    torch.testing.assert_close(a, grid[before.leaves.samples, :, x, y, z])


def test_turning_leaves_its_input_alone() -> None:
    frames, proprio, action = random_frames(2), random_proprio(2), torch.rand(2, 5)
    copies = frames.clone(), proprio.clone(), action.clone()
    augment(torch.tensor([3, 5]), frames, proprio, action, SPEC)
    assert torch.equal(frames.features, copies[0].features)
    assert torch.equal(frames.codes, copies[0].codes)
    assert torch.equal(proprio, copies[1])
    assert torch.equal(action, copies[2])


def test_random_elements_come_from_the_generator_and_cover_the_group() -> None:
    a, b = (random_elements(200, torch.Generator().manual_seed(7)) for _ in range(2))
    assert torch.equal(a, b)
    assert a.unique().tolist() == list(range(8))


@pytest.mark.parametrize("depth", [3, 4, 5, 6])
def test_every_element_permutes_the_leaves(depth: int) -> None:
    spec = OctreeSpec(SPEC.origin_m, SPEC.side_m, depth, leaf_capacity=8**depth)
    frames = OctreeFrame.unoccupied(spec, (8,))
    frames.codes[:] = torch.arange(8**depth)
    turned = turn_frames(ALL, frames, spec)
    assert torch.equal(turned.codes.sort(dim=1).values, frames.codes)
