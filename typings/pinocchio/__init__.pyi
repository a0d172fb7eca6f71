# What the package uses of Pinocchio, whose wheels declare no types.
from collections.abc import Sequence
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]

class SE3:
    homogeneous: Array
    translation: Array
    rotation: Array
    def __init__(self, matrix: Array) -> None: ...
    def inverse(self) -> SE3: ...
    @staticmethod
    def Identity() -> SE3: ...

class FrameType:
    BODY: FrameType

class ReferenceFrame:
    LOCAL: ReferenceFrame

class GeometryType:
    COLLISION: GeometryType

class Frame:
    name: str
    type: FrameType
    placement: SE3

class JointModel:
    idx_q: int

class JointModelFreeFlyer(JointModel): ...

class Data:
    oMi: Sequence[SE3]
    oMf: Sequence[SE3]

class Model:
    nq: int
    names: Sequence[str]
    joints: Sequence[JointModel]
    frames: Sequence[Frame]
    parents: Sequence[int]
    jointPlacements: Sequence[SE3]
    def __init__(self, other: Model = ...) -> None: ...
    def createData(self) -> Data: ...
    def getJointId(self, name: str) -> int: ...
    def getFrameId(self, name: str, type: FrameType = ...) -> int: ...
    def addJoint(self, parent: int, joint: JointModel, placement: SE3, name: str) -> int: ...

class CollisionPair:
    first: int
    second: int
    def __init__(self, first: int, second: int) -> None: ...

class GeometryObject:
    name: str
    geometry: Any
    parentJoint: int
    parentFrame: int
    placement: SE3
    def __init__(self, name: str, parent_joint: int, parent_frame: int, placement: SE3, geometry: Any) -> None: ...

class CollisionResult:
    def isCollision(self) -> bool: ...

class DistanceResult:
    min_distance: float

class GeometryData:
    collisionResults: Sequence[CollisionResult]
    distanceResults: Sequence[DistanceResult]

class GeometryModel:
    geometryObjects: Sequence[GeometryObject]
    collisionPairs: Sequence[CollisionPair]
    def createData(self) -> GeometryData: ...
    def addCollisionPair(self, pair: CollisionPair) -> None: ...
    def addGeometryObject(self, shape: GeometryObject) -> int: ...

class TreeBroadPhaseManagerPool_DynamicAABBTreeCollisionManager:
    def __init__(self, model: Model, shapes: GeometryModel, size: int) -> None: ...

def buildModelFromXML(urdf: str) -> Model: ...
def buildGeomFromUrdfString(model: Model, urdf: str, type: GeometryType) -> GeometryModel: ...
@overload
def buildReducedModel(model: Model, locked: Sequence[int], q: Array) -> Model: ...
@overload
def buildReducedModel(
    model: Model, shapes: GeometryModel, locked: Sequence[int], q: Array
) -> tuple[Model, GeometryModel]: ...
def neutral(model: Model) -> Array: ...
def forwardKinematics(model: Model, data: Data, q: Array) -> None: ...
def framesForwardKinematics(model: Model, data: Data, q: Array) -> None: ...
def computeJointJacobians(model: Model, data: Data, q: Array) -> Array: ...
def getJointJacobian(model: Model, data: Data, joint: int, frame: ReferenceFrame) -> Array: ...
def computeCollisions(
    model: Model, data: Data, shapes: GeometryModel, results: GeometryData, q: Array, stop_at_first: bool
) -> bool: ...
def computeCollisionsInParallel(
    threads_n: int,
    pool: TreeBroadPhaseManagerPool_DynamicAABBTreeCollisionManager,
    q: Array,
    stop_at_first_in_configuration: bool,
    stop_at_first: bool,
) -> NDArray[np.bool_]: ...
def computeDistances(model: Model, data: Data, shapes: GeometryModel, results: GeometryData, q: Array) -> int: ...
def SE3ToXYZQUAT(pose: SE3) -> Array: ...
def exp3(turn: Array) -> Array: ...
def log3(rotation: Array) -> Array: ...
