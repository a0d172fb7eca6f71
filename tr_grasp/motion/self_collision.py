"""Which parts of an arm can meet, found out once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pinocchio as pin

from tr_grasp.motion.kinematics import Kinematics

Pair = tuple[int, int]
ALWAYS_SHARE = 0.95


@dataclass(frozen=True)
class SelfCollisionMatrix:
    """Pairs of the arm's collision shapes (indices), by whether they need checking.

    Attributes:
        neighbours: On one link or on links that share a joint; they touch by design.
        always: Overlap in nearly all of the sampled postures, so the model and not the posture makes them.
        never: In none of the samples; they are checked all the same, since samples prove nothing and the check is free.
        sometimes: What checking is for.
    """

    neighbours: tuple[Pair, ...]
    always: tuple[Pair, ...]
    never: tuple[Pair, ...]
    sometimes: tuple[Pair, ...]

    @property
    def checked(self) -> tuple[Pair, ...]:
        """Pairs that collision models check."""
        return self.sometimes + self.never


def arm_shapes(kinematics: Kinematics) -> pin.GeometryModel:
    """Collision shapes of the arm with locked fingers; meshes as their convex hulls."""
    full = pin.buildGeomFromUrdfString(kinematics.full_model, kinematics.urdf, pin.GeometryType.COLLISION)
    _, shapes = pin.buildReducedModel(kinematics.full_model, full, kinematics.locked, kinematics.full_q)
    for shape in shapes.geometryObjects:
        if hasattr(shape.geometry, "buildConvexRepresentation"):
            shape.geometry.buildConvexRepresentation(False)
            shape.geometry = shape.geometry.convex
    return shapes


@lru_cache(maxsize=16)
def self_collision_matrix(kinematics: Kinematics, samples_n: int = 1000, seed: int = 0) -> SelfCollisionMatrix:
    """Sort all pairs of shapes by sampling postures within the limits; computed once for each arm."""
    shapes, model = arm_shapes(kinematics), kinematics.model
    parents = [shape.parentJoint for shape in shapes.geometryObjects]
    neighbours, candidates = [], []
    for i in range(len(parents)):
        for j in range(i + 1, len(parents)):
            a, b = parents[i], parents[j]
            touching = a == b or model.parents[a] == b or model.parents[b] == a
            (neighbours if touching else candidates).append((i, j))
    for pair in candidates:
        shapes.addCollisionPair(pin.CollisionPair(*pair))

    data, results = model.createData(), shapes.createData()
    rng = np.random.default_rng(seed)
    lower, upper = np.maximum(kinematics.lower_rad, -np.pi), np.minimum(kinematics.upper_rad, np.pi)
    lower, upper = np.where(lower < upper, (lower, upper), (kinematics.lower_rad, kinematics.upper_rad))
    hits = np.zeros(len(candidates))
    for q in rng.uniform(lower, upper, (samples_n, kinematics.dof)):
        pin.computeCollisions(model, data, shapes, results, q, False)
        hits += [result.isCollision() for result in results.collisionResults]
    share = hits / samples_n
    by_kind = [
        tuple(pair for pair, is_kind in zip(candidates, kind, strict=True) if is_kind)
        for kind in (share >= ALWAYS_SHARE, share == 0, (share > 0) & (share < ALWAYS_SHARE))
    ]
    return SelfCollisionMatrix(tuple(neighbours), *by_kind)
