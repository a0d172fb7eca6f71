"""What the browser is given to draw."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
import trimesh
from numpy.typing import NDArray
from PIL import Image
from tensordict import TensorDictBase

from tr_grasp import keys
from tr_grasp.envs import GraspNovelObjectsEnv, Outcome
from tr_grasp.envs.robot_bodies import TABLE_COLOUR
from tr_grasp.octree import OctreeFrame, OctreeSpec
from tr_grasp.octree.morton import cell_table
from tr_grasp.sensing import Body
from tr_grasp.sensing.look import GroundTexture

Array = NDArray[np.floating]
GROUND_HALF_SIDE_M = 1.0
NO_COLOUR = (140, 158, 184)
"""Leaves of an octree without colour."""


@dataclass(frozen=True, eq=False)
class Snapshot:
    """All of one instant that the browser shows."""

    step: int
    poses: Array
    """``(bodies, 4, 4)`` ``T_base_body``."""
    points: NDArray[np.float32]
    """``(n, 3)`` what the camera saw of the cube [m]."""
    point_colours: NDArray[np.uint8]
    leaves: NDArray[np.float32]
    """``(leaves, 3)`` centres of the octree's leaves [m]."""
    leaf_colours: NDArray[np.uint8]
    image: NDArray[np.uint8]
    """``(h, w, 3)`` the camera's picture."""
    text: str
    """How the episode stands."""


def snapshot(task: GraspNovelObjectsEnv, step: int, state: TensorDictBase) -> Snapshot:
    """The present instant of a task."""
    cloud, spec = task.sensor.cloud(), task.sensor.spec
    leaves, leaf_colours = octree_leaves(state[keys.OCTREE][-1], spec)
    return Snapshot(
        step=step,
        poses=task.view.poses(),
        points=cloud.points,
        point_colours=_bytes(cloud.colours),
        leaves=leaves,
        leaf_colours=leaf_colours,
        image=_bytes(task.sensor.image.colour),
        text=f"step {step}: {Outcome(int(state[keys.OUTCOME])).label}",
    )


def octree_leaves(frame: OctreeFrame, spec: OctreeSpec) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """Centres ``(n, 3)`` [m] and colours ``(n, 3)`` of the leaves of an octree (batch ``[]``)."""
    used = frame.codes >= 0
    cells = cell_table(spec.depth, torch.device("cpu"))[frame.codes[used].long()]
    centres = np.array(spec.origin_m) + (cells.numpy() + 0.5) * spec.leaf_m
    if spec.channels < 7:
        return centres.astype(np.float32), np.tile(np.uint8(NO_COLOUR), (len(cells), 1))
    return centres.astype(np.float32), _bytes(frame.features[used][:, 4:7].float().numpy())


def body_mesh(body: Body) -> trimesh.Trimesh:
    """A body whose faces have vertices of their own, so that they keep their colours and edges."""
    corners = np.asarray(body.vertices)[body.faces].reshape(-1, 3)
    colours = np.repeat(_bytes(body.face_colours), 3, axis=0)
    return trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3), vertex_colors=colours, process=False)


def ground_mesh(ground: GroundTexture | None) -> trimesh.Trimesh:
    """A square of the table with its texture."""
    ground = ground or GroundTexture.uniform(TABLE_COLOUR)
    corners = GROUND_HALF_SIDE_M * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float)
    uv = ground.uv(corners[:, :2]) * [1, -1]  # trimesh counts rows from below
    image = Image.fromarray(_bytes(ground.image))
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=image, metallicFactor=0.0, roughnessFactor=0.9)
    visual = trimesh.visual.TextureVisuals(uv, material=material)
    return trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], visual=visual, process=False)


def _bytes(colours: Array) -> NDArray[np.uint8]:
    return np.round(255 * np.clip(colours, 0, 1)).astype(np.uint8)
