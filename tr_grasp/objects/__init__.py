"""What is grasped: procedural families and sets of meshes. ``actors`` puts them into a simulation."""

from tr_grasp.objects.conveyor import ConveyorObject, conveyor_names, conveyor_object, conveyor_objects
from tr_grasp.objects.families import FAMILIES, family_names
from tr_grasp.objects.mesh_set import MeshSet
from tr_grasp.objects.model import ObjectModel
from tr_grasp.objects.orientation import Orientation, random_orientation
from tr_grasp.objects.rejection import Reason, Rejection
from tr_grasp.objects.sets import ObjectSet, ProceduralSet, object_set
from tr_grasp.objects.single import single_object

__all__ = [
    "FAMILIES",
    "ConveyorObject",
    "MeshSet",
    "ObjectModel",
    "ObjectSet",
    "Orientation",
    "ProceduralSet",
    "Reason",
    "Rejection",
    "conveyor_names",
    "conveyor_object",
    "conveyor_objects",
    "family_names",
    "object_set",
    "random_orientation",
    "single_object",
]
