"""Where to hold."""

from tr_grasp.grasps.height_map import HeightMap, height_map
from tr_grasp.grasps.top_down import Grasp, GripperShape, TopDownGrasps, top_down_grasps

__all__ = ["Grasp", "GripperShape", "HeightMap", "TopDownGrasps", "height_map", "top_down_grasps"]
