# What the package uses of coal, whose wheels declare no types.
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]

class CollisionGeometry:
    def clone(self) -> CollisionGeometry: ...
    # Those two of all but octrees.
    def getSweptSphereRadius(self) -> float: ...
    def setSweptSphereRadius(self, radius: float) -> None: ...

class Box(CollisionGeometry):
    def __init__(self, x: float, y: float, z: float) -> None: ...

class ConvexBase(CollisionGeometry): ...

class Convex(ConvexBase):
    @staticmethod
    def convexHull(points: StdVec_Vec3s, keep_triangles: bool, qhull_command: str) -> ConvexBase: ...

class OcTree(CollisionGeometry): ...

class StdVec_Vec3s:
    def extend(self, points: Iterable[Array]) -> None: ...

class Transform3s:
    def __init__(self, rotation: Array = ..., translation: Array = ...) -> None: ...
    def setRotation(self, rotation: Array) -> None: ...
    def setTranslation(self, translation: Array) -> None: ...
    @staticmethod
    def Identity() -> Transform3s: ...

class CollisionRequest:
    security_margin: float

class CollisionResult:
    def clear(self) -> None: ...

def collide(
    first: CollisionGeometry,
    at_first: Transform3s,
    second: CollisionGeometry,
    at_second: Transform3s,
    request: CollisionRequest,
    result: CollisionResult,
) -> int: ...
def makeOctree(points: Array, resolution: float) -> OcTree: ...
