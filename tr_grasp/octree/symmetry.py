"""Turning and mirroring an observation about the cube's vertical axis, for data augmentation.

The group has eight elements, numbered ``4 * mirrored + quarter_turns``: first, if mirrored, y changes its sign about
the cube's centre; then the scene turns counter-clockwise, seen from above, by that many right angles. Every leaf lands
on a leaf, so octrees are moved by a table, without error. A symmetric parallel gripper, mirrored, is again that
gripper with its closing axis reversed, which keeps its rotation a rotation.
"""

from __future__ import annotations

from functools import cache

import torch
from torch import Tensor

from tr_grasp.octree.frame import PADDING, OctreeFrame
from tr_grasp.octree.morton import cell_table, raster_table
from tr_grasp.octree.spec import OctreeSpec, code_dtype

ELEMENTS_N = 8
IDENTITY = 0


def random_elements(n: int, generator: torch.Generator | None = None, device: torch.device | str = "cpu") -> Tensor:
    """``n`` elements, int64, each of the eight equally likely."""
    return torch.randint(ELEMENTS_N, (n,), generator=generator, device=device)


def compose(first: Tensor, then: Tensor) -> Tensor:
    """The element that does ``first`` and afterwards ``then``."""
    turns_first, mirror_first = first % 4, first // 4
    turns_then, mirror_then = then % 4, then // 4
    turns = (turns_then + torch.where(mirror_then == 1, -turns_first, turns_first)) % 4
    return 4 * (mirror_first ^ mirror_then) + turns


def inverse(elements: Tensor) -> Tensor:
    """The element that undoes each element. A mirrored one undoes itself."""
    return torch.where(elements < 4, -elements % 4, elements)


def rotations(elements: Tensor, dtype: torch.dtype = torch.float32) -> Tensor:
    """``(*elements.shape, 2, 2)``: what each element does to horizontal vectors; mirrored ones have determinant -1."""
    return _rotation_table(elements.device).to(dtype)[elements]


def turn_frames(elements: Tensor, frames: OctreeFrame, spec: OctreeSpec) -> OctreeFrame:
    """Move the leaves and their normals; distance and colour stay.

    Args:
        elements: int64 ``(B,)``, one element for each sample.
        frames: Batch size ``(B, *rest)``.
        spec: The cube of the frames.

    Returns:
        Frames of the same shape. Leaves keep their slot, so their codes are no longer ascending; ``Octree`` does not
        mind.
    """
    table = _code_table(spec.depth, frames.codes.device)
    rows = _expand(elements, frames.codes).int() * table.shape[1]
    codes = table.view(-1)[rows + frames.codes - PADDING]
    features = frames.features.clone()
    features[..., :2] = _turn_horizontal(elements, frames.features[..., :2])
    return OctreeFrame(codes=codes, features=features, batch_size=frames.batch_size)


def turn_proprio(elements: Tensor, proprio: Tensor, spec: OctreeSpec) -> Tensor:
    """Move the tool: ``proprio`` is ``(B, *rest, 10)`` = gripper, tcp position [m], R_base_tcp[:, 0] and [:, 1]."""
    turned = proprio.clone()
    centre = proprio.new_tensor(spec.centre_m[:2])
    turned[..., 1:3] = _turn_horizontal(elements, proprio[..., 1:3] - centre) + centre
    turned[..., 4:6] = _turn_horizontal(elements, proprio[..., 4:6])
    handedness = _expand(_handedness(elements, proprio.dtype), proprio)
    turned[..., 7:9] = _turn_horizontal(elements, proprio[..., 7:9]) * handedness
    turned[..., 9:10] = proprio[..., 9:10] * handedness
    return turned


def turn_action(elements: Tensor, action: Tensor) -> Tensor:
    """Turn the motion: ``action`` is ``(B, *rest, 5)`` = dx, dy, dz, dphi, gripper; a mirror reverses dphi."""
    turned = action.clone()
    turned[..., :2] = _turn_horizontal(elements, action[..., :2])
    turned[..., 3:4] *= _expand(_handedness(elements, action.dtype), action)
    return turned


def turn_target(elements: Tensor, target: Tensor) -> Tensor:
    """Turn a grasp as seen from the tool, ``(B, 6)`` as ``keys.EXPERT_TARGET``; a mirror reverses its sine."""
    turned = target.clone()
    turned[:, :2] = _turn_horizontal(elements, target[:, :2])
    turned[:, 4] *= _handedness(elements, target.dtype)
    return turned


def augment(
    elements: Tensor, frames: OctreeFrame, proprio: Tensor, action: Tensor, spec: OctreeSpec
) -> tuple[OctreeFrame, Tensor, Tensor]:
    """Frames, proprioception and action of ``B`` samples, each sample turned by its own element ``(B,)``."""
    return turn_frames(elements, frames, spec), turn_proprio(elements, proprio, spec), turn_action(elements, action)


def _expand(values: Tensor, like: Tensor) -> Tensor:
    """``(B,)`` as ``(B, 1, ...)`` with as many dimensions as ``like``."""
    return values.view(-1, *[1] * (like.ndim - 1))


def _handedness(elements: Tensor, dtype: torch.dtype) -> Tensor:
    return (1 - 2 * (elements // 4)).to(dtype)


def _turn_horizontal(elements: Tensor, vectors: Tensor) -> Tensor:
    """Turn ``(B, *rest, 2)``. Exact in any dtype: the entries of the matrices are 0, 1 and -1."""
    matrices = rotations(elements, vectors.dtype).view(-1, *[1] * (vectors.ndim - 2), 2, 2)
    x, y = vectors[..., :1], vectors[..., 1:]
    return x * matrices[..., 0] + y * matrices[..., 1]


@cache
def _rotation_table(device: torch.device) -> Tensor:
    quarter_turn = torch.tensor([[0.0, -1.0], [1.0, 0.0]])
    turns = [torch.linalg.matrix_power(quarter_turn, n) for n in range(4)]
    mirror = torch.diag(torch.tensor([1.0, -1.0]))
    return torch.stack(turns + [turn @ mirror for turn in turns]).to(device)


@cache
def _code_table(depth: int, device: torch.device) -> Tensor:
    """``(8, 1 + 8**depth)``, codes: where each element takes each code; column 0 keeps padding as it is."""
    cells = cell_table(depth, torch.device("cpu"))
    # Twice the distance from the centre is an integer: no rounding.
    centred = (2 * cells[:, :2] - (2**depth - 1)).float()
    code_of_raster = torch.empty(8**depth, dtype=torch.int64)
    code_of_raster[raster_table(depth, 0, torch.device("cpu"))] = torch.arange(8**depth)
    rows = []
    for matrix in _rotation_table(torch.device("cpu")):
        x, y = ((centred @ matrix.T + (2**depth - 1)) / 2).long().unbind(1)
        rows.append(code_of_raster[(x * 2**depth + y) * 2**depth + cells[:, 2]])
    table = torch.cat([torch.full((ELEMENTS_N, 1), PADDING), torch.stack(rows)], dim=1)
    return table.to(code_dtype(depth)).to(device)
