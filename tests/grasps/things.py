"""Objects and fake trials for the tests of grasp sets."""

from __future__ import annotations

import numpy as np

from tr_grasp.grasps import Grasps
from tr_grasp.objects import ObjectModel, shapes


def brick(size_m=(0.04, 0.09, 0.12), name: str = "brick") -> ObjectModel:
    solid = shapes.box(size_m)
    return ObjectModel.assemble(name, name, [solid], solid, np.full((len(solid.faces), 3), 0.5))


def two_halves() -> ObjectModel:
    """The same brick, glued together from two boxes that meet at x = 0."""
    parts = [shapes.box((0.02, 0.09, 0.12), (x, 0.0, 0.0)) for x in (-0.01, 0.01)]
    visual = shapes.box((0.04, 0.09, 0.12))
    return ObjectModel.assemble("halves", "halves", parts, visual, np.full((len(visual.faces), 3), 0.5))


def grasps_at(positions, width_m: float = 0.04) -> Grasps:
    """Hands that point along -y of the object and close along x."""
    positions = np.atleast_2d(np.asarray(positions, float))
    # Columns x, y, z of the tcp: (0, 0, -1), (1, 0, 0), (0, -1, 0).
    q = np.array([0.5, 0.5, -0.5, 0.5])
    return Grasps(positions, np.tile(q, (len(positions), 1)), np.full(len(positions), width_m))


class HoldsWith:
    """Each grasp holds with a probability that depends on its height; counts how often it was asked."""

    def __init__(self, probability=lambda grasps: np.where(grasps.position_m[:, 2] > 0, 1.0, 0.5)) -> None:
        self.probability, self.calls = probability, 0

    def __call__(self, grasps: Grasps, rng: np.random.Generator):
        self.calls += 1
        return rng.uniform(size=len(grasps)) < self.probability(grasps)
