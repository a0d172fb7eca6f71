"""The laboratory of hand-eye calibration as SAPIEN's renderer draws it: arm, board, table, and a sun with shadows."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
import sapien
import trimesh
from numpy.typing import NDArray
from sapien import render

from tr_grasp.calibration import BoardSpec, Intrinsics
from tr_grasp.calibration.rendering import INK, PAPER, SUBPIXELS, subpixel_directions
from tr_grasp.envs.drawn_scene import GROUND_HALF_SIDE_M, light_scene
from tr_grasp.envs.robot_bodies import TABLE_COLOUR
from tr_grasp.motion import Kinematics
from tr_grasp.robots import robot_spec
from tr_grasp.robots.bodies import robot_bodies
from tr_grasp.sensing import Body, PinholeCamera
from tr_grasp.sensing.look import GroundTexture
from tr_grasp.sensing.sapien_bodies import render_body, render_ground
from tr_grasp.sensing.sapien_camera import SapienCamera

Array = NDArray[np.floating]
PLATE_M, BEHIND_M = 0.003, 0.0005
"""Thickness of the plate that the board is glued on, and how far it is behind the print, so that they do not mix."""
PLATE_COLOUR = (0.55, 0.55, 0.57)


class SapienEye:
    """The eye of a :class:`~tr_grasp.calibration.Laboratory` that photographs the board in a hand or on the table.

    Other than the ray caster's, its pictures show the arm, which may hide the board, and shadows that fall on it.

    Args:
        robot: Name of the arm.
        board: The board.

    Raises:
        RuntimeError: There is no Vulkan device.
    """

    def __init__(self, robot: str, board: BoardSpec) -> None:
        spec = robot_spec(robot)
        # The hand is closed, around the board's edge or around nothing.
        self._kinematics = Kinematics(spec, opening_m=spec.gripper.opening_range_m[0])
        self._scene = sapien.Scene([render.RenderSystem()])
        light_scene(self._scene)
        self._links = {name: self._add(render_body(body)) for name, body in robot_bodies(spec).items()}
        self._board = [self._add(render_body(body)) for body in (printed_board(board), _plate(board))]
        table = self._add(render_ground(GroundTexture.uniform(TABLE_COLOUR), GROUND_HALF_SIDE_M))
        table.set_pose(sapien.Pose([0.0, 0.0, -BEHIND_M - PLATE_M]))  # so that a board that lies on it is at z = 0

    def picture(self, camera: Intrinsics, T_base_cam: Array, T_base_board: Array, q_rad: Array) -> Array:
        """(h, w, 3) float32 levels out of 255 of a camera without blur and noise."""
        for name, link in self._links.items():
            link.set_pose(sapien.Pose(self._kinematics.link_pose(q_rad, name)))
        for part in self._board:
            part.set_pose(sapien.Pose(T_base_board))
        fov_rad, (width_px, height_px), columns, rows = _without_lens(camera)
        eye = SapienCamera(self._scene, PinholeCamera(T_base_cam, fov_rad, width_px, height_px))
        try:
            shown = eye.photograph()
        finally:
            eye.remove()
        fine = cv2.remap(shown, columns, rows, cv2.INTER_LINEAR).astype(np.float32)
        return cv2.resize(fine, (camera.width_px, camera.height_px), interpolation=cv2.INTER_AREA)

    def _add(self, body: render.RenderBodyComponent) -> sapien.Entity:
        entity = sapien.Entity()
        entity.add_component(body)
        self._scene.add_entity(entity)
        return entity


def printed_board(board: BoardSpec) -> Body:
    """What is printed, in the board's frame: exact rectangles of ink and paper, to be seen from -z."""
    outline, black = board.outline_board, board.black_board
    x = _distinct(np.concatenate([outline[:, 0], black[:, 0], black[:, 2]]))
    y = _distinct(np.concatenate([outline[:, 1], black[:, 1], black[:, 3]]))
    centres = np.stack(np.meshgrid((x[1:] + x[:-1]) / 2, (y[1:] + y[:-1]) / 2), axis=-1)[..., None, :]
    inked = ((centres > black[:, :2]) & (centres < black[:, 2:])).all(axis=-1).any(axis=-1)
    vertices = np.stack([*np.meshgrid(x, y), np.zeros((len(y), len(x)))], axis=-1).reshape(-1, 3)
    first = (np.arange(len(y) - 1)[:, None] * len(x) + np.arange(len(x) - 1)).ravel()
    below = first + len(x)
    faces = np.stack([first, below, below + 1, first, below + 1, first + 1], axis=1).reshape(-1, 3)
    level = np.where(inked.ravel(), INK, PAPER) / 255
    return Body(vertices, faces, np.repeat(level, 2)[:, None] * np.ones(3))


def _plate(board: BoardSpec) -> Body:
    """What carries the paper."""
    low, high = board.outline_board.min(axis=0), board.outline_board.max(axis=0)
    mesh = trimesh.creation.box((*(high - low)[:2], PLATE_M))
    return Body.uniform(mesh.vertices + (low + high) / 2 + [0, 0, BEHIND_M + PLATE_M / 2], mesh.faces, PLATE_COLOUR)


def _distinct(values: Array) -> Array:
    """Sorted, those closer than a nanometre taken for one."""
    ordered = np.sort(values)
    return ordered[np.diff(ordered, prepend=-np.inf) > 1e-9]


@lru_cache(maxsize=2)
def _without_lens(camera: Intrinsics) -> tuple[float, tuple[int, int], NDArray[np.float32], NDArray[np.float32]]:
    """A camera without lens that sees as much: field of view, size, and where in its picture each subpixel is."""
    size = np.array([camera.width_px, camera.height_px])
    directions = subpixel_directions(camera, np.zeros(2, int), size)[..., :2]
    # The renderer takes one sample a pixel: SUBPIXELS² of its pixels make one of the camera's.
    focal_px = SUBPIXELS * max(camera.fx_px, camera.fy_px)
    half_px = np.ceil(np.abs(directions).max(axis=(0, 1)) * focal_px).astype(int) + 1
    places = (directions * focal_px + half_px - 0.5).astype(np.float32)
    fov_rad = 2 * float(np.arctan(half_px[1] / focal_px))
    return fov_rad, (int(2 * half_px[0]), int(2 * half_px[1])), places[..., 0].copy(), places[..., 1].copy()
