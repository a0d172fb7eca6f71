"""A picture of a grasp set: all grasps as forks around the object, and the hand itself at the best ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from tr_grasp.errors import GraspError
from tr_grasp.files import write_atomically
from tr_grasp.geometry import transform_points
from tr_grasp.grasps.grasp_set import GraspSet
from tr_grasp.grasps.grippers import floating_gripper, gripper_links, hand_poses
from tr_grasp.objects import ObjectModel, shapes
from tr_grasp.robots.bodies import link_body
from tr_grasp.sensing import Body, PinholeCamera, RaycastScene

Array = NDArray[np.floating]
TILE_PX, OVERVIEW_PX, FOV_RAD = 300, 620, 0.55
TABLE_M, FORK_M = 0.16, 0.0016
SUN = np.array([0.35, -0.45, 0.82])
PAPER = np.array([0.965, 0.97, 0.975])
WOOD, WEAK, STRONG = (0.80, 0.78, 0.74), np.array([0.85, 0.30, 0.25]), np.array([0.13, 0.55, 0.33])


def contact_sheet(grasp_set: GraspSet, model: ObjectModel, path: str | Path, *, tiles_n: int = 12) -> Path:
    """Write a PNG: every grasp as a fork (green holds always, red less often) and the hand at the first few.

    Args:
        grasp_set: The grasps.
        model: The object they were made for.
        path: Ends in ``.png``; its folder exists.
        tiles_n: Hands drawn; no more than there are grasps.

    Raises:
        GraspError: Another ending, or a set of another object.
        StorageError: It could not be written.
    """
    path = Path(path)
    if path.suffix.lower() != ".png":
        raise GraspError(f"a contact sheet is a .png file, got '{path}'.")
    grasp_set.require_for(model)
    best = grasp_set.top(tiles_n)
    columns = 4
    rows = 2 + -(-max(len(best) - 4, 0) // columns)
    figure = Figure(figsize=(12.0, 3.15 * rows), layout="constrained", facecolor=tuple(PAPER))
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(rows, columns)
    wide = figure.add_subplot(grid[:2, :2])
    wide.imshow(_overview(grasp_set, model))
    mean = 100 * grasp_set.success_rate.mean()
    wide.set_title(
        f"{grasp_set.object_name}, {grasp_set.gripper}: {len(grasp_set)} grasps, {mean:.1f} % held", fontsize=11
    )
    cells = [(row, column) for row in range(rows) for column in range(columns) if row > 1 or column > 1]
    axes = [wide]
    for k, (row, column) in zip(range(len(best)), cells, strict=False):
        axis = figure.add_subplot(grid[row, column])
        axis.imshow(_hand_tile(best, k, model))
        axis.set_title(
            f"{k + 1}: {best.successes[k]} of {best.tries[k]}, {1e3 * best.grasps.width_m[k]:.0f} mm", fontsize=9
        )
        axes.append(axis)
    for axis in axes:
        axis.set_axis_off()
    write_atomically(path, lambda file: figure.savefig(file, format="png", dpi=100))
    return path


def _overview(grasp_set: GraspSet, model: ObjectModel) -> NDArray[np.uint8]:
    share = np.clip((grasp_set.success_rate - 0.8) / 0.2, 0.0, 1.0)[:, None]
    colours = (1 - share) * WEAK + share * STRONG
    forks = [
        _fork(T, width, colour)
        for T, width, colour in zip(grasp_set.grasps.poses(), grasp_set.grasps.width_m, colours, strict=True)
    ]
    middle = model.bounds_m.mean(axis=0)
    eye = middle + 0.85 * _unit(np.array([0.75, -1.0, 0.55]))
    return _drawn([_object_body(model), *forks], model, eye, middle, OVERVIEW_PX)


def _hand_tile(grasp_set: GraspSet, k: int, model: ObjectModel) -> NDArray[np.uint8]:
    gripper = floating_gripper(grasp_set.gripper)
    width = float(grasp_set.grasps.width_m[k])
    poses = hand_poses(gripper, gripper.gripper.openness(width))
    T = grasp_set.grasps.poses()[k]
    links = [_placed(link_body(link), T @ poses[link.name]) for link in gripper_links(grasp_set.gripper)]
    across, approach = T[:3, 0], T[:3, 2]
    across = across if across[2] + 0.3 * across[0] - 0.3 * across[1] >= 0 else -across
    target = T[:3, 3] - 0.04 * approach
    eye = target + 0.55 * _unit(across + np.array([0.0, 0.0, 0.55]) - 0.25 * approach + 0.25 * T[:3, 1])
    eye[2] = max(eye[2], model.bounds_m[0, 2] + 0.08)
    return _drawn([_object_body(model), *links], model, eye, target, TILE_PX)


def _drawn(bodies: list[Body], model: ObjectModel, eye: Array, target: Array, size_px: int) -> NDArray[np.uint8]:
    """(size, size, 3) shaded, with the shadow of one sun."""
    table = shapes.box((2 * TABLE_M, 2 * TABLE_M, 0.004), (0.0, 0.0, float(model.bounds_m[0, 2]) - 0.002))
    scene = RaycastScene([*bodies, Body.uniform(table.vertices, table.faces, WOOD)])
    poses = np.tile(np.eye(4), (len(bodies) + 1, 1, 1))
    rays = PinholeCamera.looking_at(tuple(eye), tuple(target), FOV_RAD, size_px).rays_base
    hits = scene.cast(rays, poses)
    seen = hits.body >= 0
    facing = (hits.normals * rays[:, 3:]).sum(axis=1, keepdims=True) > 0
    normals = np.where(facing, -hits.normals, hits.normals)
    points = rays[:, :3] + rays[:, 3:] * np.where(seen, hits.distance, 0.0)[:, None] + 1e-4 * normals
    to_sun = np.concatenate([points, np.broadcast_to(SUN, points.shape)], axis=1).astype(np.float32)
    lit = ~np.isfinite(scene.cast(to_sun, poses).distance)
    light = 0.50 + 0.50 * np.clip(normals @ SUN, 0, 1) * np.where(lit, 1.0, 0.3)
    colour = np.where(seen[:, None], hits.colours * light[:, None], PAPER)
    return (255 * np.clip(colour, 0, 1)).astype(np.uint8).reshape(size_px, size_px, 3)


def _object_body(model: ObjectModel) -> Body:
    return Body(np.asarray(model.visual.vertices), np.asarray(model.visual.faces), model.face_colours)


def _fork(T_obj_tcp: Array, width_m: float, colour: Array) -> Body:
    """Stem, bar and two tines of a hand that holds something this wide."""
    half, thick, back = width_m / 2 + 0.004, FORK_M, -0.055
    bars = [
        shapes.box((thick, thick, 0.05), (0.0, 0.0, back - 0.025)),
        shapes.box((thick, 2 * half, thick), (0.0, 0.0, back)),
        *(shapes.box((thick, thick, -back), (0.0, side * half, back / 2)) for side in (-1, 1)),
    ]
    offsets = np.cumsum([0, *(len(bar.vertices) for bar in bars[:-1])])
    faces = np.concatenate([bar.faces + offset for bar, offset in zip(bars, offsets, strict=True)])
    return Body.uniform(transform_points(T_obj_tcp, np.concatenate([bar.vertices for bar in bars])), faces, colour)


def _placed(body: Body, T: Array) -> Body:
    return Body(transform_points(T, np.asarray(body.vertices)), body.faces, body.face_colours)


def _unit(vector: Array) -> Array:
    return vector / np.linalg.norm(vector)
