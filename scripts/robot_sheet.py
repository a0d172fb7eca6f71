"""Draw a contact sheet of the robots: at home with the gripper open, and the gripper open, half open and closed.

python scripts/robot_sheet.py robots.png
python scripts/robot_sheet.py robots.png panda my_robot.yaml
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from tr_grasp.robots.bodies import robot_bodies
from tr_grasp.robots.chain import link_poses
from tr_grasp.robots.spec import RobotSpec, robot_names, robot_spec
from tr_grasp.sensing import Body, PinholeCamera, RaycastScene

TILE_PX, OVERSAMPLING = 480, 3
FLOOR_COLOUR, SKY_COLOUR = (0.80, 0.80, 0.79), (0.96, 0.97, 0.98)
EYE_FROM_TOOL, ABOVE_TOOL = np.array([0.42, -0.16, 0.10]), np.array([0.0, 0.0, 0.05])
SUN = np.array([0.45, -0.35, 0.82])


def sheet(names: list[str]) -> Image.Image:
    """One row for each robot."""
    rows = [np.concatenate(list(_tiles(robot_spec(name))), axis=1) for name in names]
    picture = Image.fromarray(np.concatenate(rows))
    draw, font = ImageDraw.Draw(picture), ImageFont.load_default(size=20)
    for row, name in enumerate(names):
        gripper = robot_spec(name).gripper
        closed, opened = (1000 * opening for opening in gripper.opening_range_m)
        widths = {"open": opened, "half": (opened + closed) / 2, "closed": closed}
        captions = [name, *(f"{word} {round(width)} mm" for word, width in widths.items())]
        for column, caption in enumerate(captions):
            corner = (column * TILE_PX + 12, row * TILE_PX + 10)
            left, top, right, bottom = draw.textbbox(corner, caption, font=font)
            draw.rectangle((left - 6, top - 4, right + 6, bottom + 4), fill=(255, 255, 255))
            draw.text(corner, caption, fill=(30, 30, 30), font=font)
    return picture


def _tiles(spec: RobotSpec):
    gripper = spec.gripper
    closed, opened = gripper.opening_range_m
    yield draw_robot(spec, opened, eye=(1.30, -1.15, 0.85), target=(0.24, 0.0, 0.32), fov_rad=0.50)
    tool = link_poses(spec, spec.home_q_rad)[spec.tcp_link][:3, 3]
    for opening in (opened, (opened + closed) / 2, closed):
        yield draw_robot(spec, opening, eye=tool + EYE_FROM_TOOL, target=tool + ABOVE_TOOL, fov_rad=0.62)


def draw_robot(spec: RobotSpec, opening_m: float, *, eye, target, fov_rad: float) -> NDArray[np.uint8]:
    """A shaded (TILE_PX, TILE_PX, 3) picture of a robot at home."""
    bodies = robot_bodies(spec)
    poses = link_poses(spec, spec.home_q_rad, spec.gripper.joint_positions(opening_m))
    floor = 2.5 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float)
    scene = RaycastScene(list(bodies.values()), [Body.uniform(floor, [[0, 1, 2], [0, 2, 3]], FLOOR_COLOUR)])
    return _shaded(scene, np.stack([poses[name] for name in bodies]), eye, target, fov_rad)


def _shaded(scene: RaycastScene, poses: NDArray, eye, target, fov_rad: float) -> NDArray[np.uint8]:
    size = TILE_PX * OVERSAMPLING
    rays = PinholeCamera.looking_at(eye, target, fov_rad, size).rays_base
    hits = scene.cast(rays, poses)
    seen = hits.body >= 0
    direction = rays[:, 3:] / np.linalg.norm(rays[:, 3:], axis=1, keepdims=True)
    normals = np.where((hits.normals * direction).sum(1, keepdims=True) > 0, -hits.normals, hits.normals)
    points = rays[:, :3] + rays[:, 3:] * np.where(seen, hits.distance, 0.0)[:, None]
    to_sun = np.concatenate([points + 1e-3 * normals, np.broadcast_to(SUN, points.shape)], axis=1).astype(np.float32)
    lit = ~np.isfinite(scene.cast(to_sun, poses).distance)
    diffuse = np.clip(normals @ SUN, 0, 1) * np.where(lit, 1.0, 0.2)
    half = SUN - direction
    shine = np.clip((normals * half).sum(1) / np.linalg.norm(half, axis=1), 0, 1) ** 40 * lit
    colour = hits.colours * (0.50 + 0.18 * normals[:, 2:] + 0.45 * diffuse[:, None]) + 0.22 * shine[:, None]
    colour = np.where(seen[:, None], colour, SKY_COLOUR)
    blocks = np.clip(colour, 0, 1).reshape(TILE_PX, OVERSAMPLING, TILE_PX, OVERSAMPLING, 3)
    return (255 * blocks.mean(axis=(1, 3))).astype(np.uint8)


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    sheet(sys.argv[2:] or list(robot_names())).save(Path(sys.argv[1]))
