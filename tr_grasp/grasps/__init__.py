"""Where to hold."""

from tr_grasp.grasps.build import BuildCfg, build_grasp_set, candidate_grasps
from tr_grasp.grasps.grasp_set import GraspSet, shape_key, shipped_grasp_set, shipped_objects, wilson_lower
from tr_grasp.grasps.gripper_shape import GripperShape, gripper_shape
from tr_grasp.grasps.grippers import floating_gripper, gripper_names, gripper_of
from tr_grasp.grasps.height_map import HeightMap, height_map, height_map_of_points
from tr_grasp.grasps.poses import Grasps, farthest_points, pose_distance
from tr_grasp.grasps.sheet import contact_sheet
from tr_grasp.grasps.tally import forget_tally
from tr_grasp.grasps.top_down import Grasp, TopDownGrasps, top_down_grasps
from tr_grasp.grasps.trial import HandMotion, TrialCfg, TryGrasps

__all__ = [
    "BuildCfg",
    "Grasp",
    "GraspSet",
    "Grasps",
    "GripperShape",
    "HandMotion",
    "HeightMap",
    "TopDownGrasps",
    "TrialCfg",
    "TryGrasps",
    "build_grasp_set",
    "candidate_grasps",
    "contact_sheet",
    "farthest_points",
    "floating_gripper",
    "forget_tally",
    "gripper_names",
    "gripper_of",
    "gripper_shape",
    "height_map",
    "height_map_of_points",
    "pose_distance",
    "shape_key",
    "shipped_grasp_set",
    "shipped_objects",
    "top_down_grasps",
    "wilson_lower",
]
