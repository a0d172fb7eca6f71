"""Objects fall until they lie."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import sapien
from numpy.typing import NDArray

Array = NDArray[np.floating]
Body = sapien.physx.PhysxRigidDynamicComponent
SETTLE_S, SETTLE_TRIES = 2.4, 6
REST_SPEED_MPS, REST_SPIN_RADPS = 0.005, 0.1


def drop(
    system: sapien.physx.PhysxCpuSystem,
    bodies: Sequence[Body],
    draw_poses: Callable[[], Sequence[tuple[Array, Array]]],
    is_good: Callable[[], bool],
    physics_hz: int,
) -> None:
    """Let bodies fall from random poses, up to six times until they lie well.

    Args:
        system: Steps the physics.
        bodies: What falls.
        draw_poses: Draws a position (3,) [m] and an orientation (wxyz) for each of them.
        is_good: Whether they may stay as they lie.
        physics_hz: Physics steps per second.
    """
    for _ in range(SETTLE_TRIES):
        for body, (position, q) in zip(bodies, draw_poses(), strict=True):
            body.entity.set_pose(sapien.Pose(position, q))
            body.set_linear_velocity(np.zeros(3))
            body.set_angular_velocity(np.zeros(3))
        _settle(system, bodies, physics_hz)
        if is_good():
            return


def _settle(system: sapien.physx.PhysxCpuSystem, bodies: Sequence[Body], physics_hz: int) -> None:
    for step in range(int(SETTLE_S * physics_hz)):
        system.step()
        if step % 10 == 9 and step > 0.4 * physics_hz and all(_is_at_rest(body) for body in bodies):
            return


def _is_at_rest(body: Body) -> bool:
    slow = np.linalg.norm(body.linear_velocity) < REST_SPEED_MPS
    return bool(slow and np.linalg.norm(body.angular_velocity) < REST_SPIN_RADPS)
