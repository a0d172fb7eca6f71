"""Things beside a robot: they stand, move on rails, or can be pushed."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import sapien
import trimesh
from sapien import physx

from tr_grasp.errors import MotionError
from tr_grasp.hardware import PoseStreamCfg
from tr_grasp.motion import Obstacle, box, convex
from tr_grasp.motion.arguments import Array, transforms
from tr_grasp.motion.obstacles import Motion
from tr_grasp.objects import ObjectModel
from tr_grasp.objects.actors import rigid_body
from tr_grasp.sensing import Body

Vector = tuple[float, float, float]
ANY_MASS_KG = 1.0


@dataclass(frozen=True, eq=False)
class Thing:
    """A box or an object, in the base frame.

    Attributes:
        name: In reports of contacts and streams of poses.
        T_base_thing: (4, 4) where it is at first.
        size_m: Edges of a box.
        model: The object, if it is no box.
        motion: Where it is at which time, for what moves whatever touches it.
        mass_kg: Of what falls and can be pushed; without it, it stands or moves on its own.
        friction: Coefficient.
        colour: Of a box, in [0, 1].
        stream: How its pose is tracked.

    Raises:
        MotionError: Neither box nor object, or both; a pose that is not rigid; both a motion and a mass.
    """

    name: str
    T_base_thing: Array
    size_m: Vector | None = None
    model: ObjectModel | None = None
    motion: Motion | None = None
    mass_kg: float | None = None
    friction: float = 1.0
    colour: Vector = (0.55, 0.48, 0.40)
    stream: PoseStreamCfg = field(default_factory=PoseStreamCfg)

    def __post_init__(self) -> None:
        transforms(f"the pose of {self.name!r}", self.T_base_thing)
        if (self.size_m is None) == (self.model is None):
            raise MotionError(f"{self.name!r} must have either size_m (a box) or a model.")
        if self.motion is not None and self.mass_kg is not None:
            raise MotionError(f"{self.name!r} must have a motion or a mass_kg, not both.")

    def obstacles(self, margin_m: float = 0.0, may_touch: tuple[str, ...] = ()) -> list[Obstacle]:
        """What an arm has to avoid: one body, or one for each convex part."""
        given = {"margin_m": margin_m, "motion": self.motion, "may_touch": may_touch}
        if self.model is None:
            assert self.size_m is not None
            return [box(self.name, self.size_m, self.T_base_thing, **given)]
        return [
            convex(f"{self.name} part {i}", part.vertices, self.T_base_thing, **given)
            for i, part in enumerate(self.model.parts)
        ]

    def entity(self) -> sapien.Entity:
        """It, for a SAPIEN scene."""
        body = self._body()
        body.kinematic = self.mass_kg is None
        entity = sapien.Entity()
        entity.name = self.name
        entity.add_component(body)
        entity.pose = sapien.Pose(self.T_base_thing)
        return entity

    def visual(self) -> Body:
        """What cameras see of it."""
        if self.model is not None:
            return Body(self.model.visual.vertices, self.model.visual.faces, self.model.face_colours)
        mesh = trimesh.creation.box(self.size_m)
        return Body.uniform(mesh.vertices, mesh.faces, self.colour)

    def _body(self) -> physx.PhysxRigidDynamicComponent:
        mass = ANY_MASS_KG if self.mass_kg is None else self.mass_kg
        if self.model is not None:
            return rigid_body(self.model, mass_kg=mass, friction=self.friction)
        size = np.asarray(self.size_m, float)
        shape = physx.PhysxCollisionShapeBox(size / 2, physx.PhysxMaterial(self.friction, self.friction, 0.0))
        shape.set_density(mass / float(np.prod(size)))
        body = physx.PhysxRigidDynamicComponent()
        body.attach(shape)
        return body
