"""Where to hold."""

from tr_grasp.grasps.top_down import GripperShape, HeightMap, TopDownGrasps, top_down_grasps

__all__ = ["GripperShape", "HeightMap", "TopDownGrasps", "top_down_grasps"]
