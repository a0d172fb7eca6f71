"""Where to hold."""

from tr_grasp.grasps.gripper_shape import GripperShape, gripper_shape
from tr_grasp.grasps.height_map import HeightMap, height_map
from tr_grasp.grasps.top_down import Grasp, TopDownGrasps, top_down_grasps

__all__ = ["Grasp", "GripperShape", "HeightMap", "TopDownGrasps", "gripper_shape", "height_map", "top_down_grasps"]
