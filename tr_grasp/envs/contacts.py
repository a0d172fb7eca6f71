"""Who touches whom, read from the physics engine once per policy step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import sapien
from numpy.typing import NDArray

TOUCH_FORCE_N = 0.1


@dataclass(frozen=True)
class Contacts:
    """Contacts of the present instant.

    Attributes:
        force_n: (fingers, objects) size of the contact force of each finger on each object.
        normal: (fingers, objects, 3) its direction, zero where there is none.
        ground: Whether a link of the arm or hand other than its base touches the table.
    """

    force_n: NDArray[np.floating]
    normal: NDArray[np.floating]
    ground: bool

    @property
    def touched(self) -> NDArray[np.bool_]:
        """(objects,) touched by any finger."""
        return (self.force_n > TOUCH_FORCE_N).any(axis=0)

    @property
    def pinched(self) -> NDArray[np.bool_]:
        """(objects,) pressed by the first finger and any other, from directions more than 45 degrees apart.

        Source: the thesis, for two fingers. Of more, the first is the thumb that opposes the others.
        """
        pressed = self.force_n > TOUCH_FORCE_N
        cosine = (self.normal[0] * self.normal[1:]).sum(axis=-1)
        return pressed[0] & (pressed[1:] & (cosine < np.cos(np.pi / 4))).any(axis=0)


def read_contacts(
    contacts: Sequence[sapien.physx.PhysxContact],
    fingers: Sequence[Sequence[sapien.Entity]],
    objects: Sequence[sapien.Entity],
    arm: Sequence[sapien.Entity],
    ground: sapien.Entity,
    timestep_s: float,
) -> Contacts:
    """Sum the impulses of one physics step.

    Args:
        contacts: ``PhysxSystem.get_contacts()``.
        fingers: Links of each finger, in order.
        objects: Objects, in order.
        arm: Links that must not touch the table.
        ground: The table.
        timestep_s: Duration of the physics step.
    """
    finger_of = {entity: k for k, finger in enumerate(fingers) for entity in finger}
    object_of = {entity: k for k, entity in enumerate(objects)}
    forbidden = set(arm)
    impulse = np.zeros((len(fingers), len(objects), 3))
    touches_ground = False
    for contact in contacts:
        a, b = contact.bodies[0].entity, contact.bodies[1].entity
        if a in object_of or b in finger_of:
            a, b = b, a
        if a in finger_of and b in object_of:
            impulse[finger_of[a], object_of[b]] += _total_impulse(contact) * (
                1 if contact.bodies[0].entity == a else -1
            )
        elif (a == ground and b in forbidden) or (b == ground and a in forbidden):
            touches_ground |= bool(np.linalg.norm(_total_impulse(contact)) / timestep_s > TOUCH_FORCE_N)
    force = np.linalg.norm(impulse, axis=-1) / timestep_s
    direction = impulse / np.maximum(np.linalg.norm(impulse, axis=-1, keepdims=True), 1e-12)
    return Contacts(force, direction, touches_ground)


def _total_impulse(contact: sapien.physx.PhysxContact) -> NDArray[np.floating]:
    return np.sum([point.impulse for point in contact.points], axis=0) if contact.points else np.zeros(3)
