"""Octrees: points to stored frames, batches of frames to merged octrees, and the operators on them."""

from tr_grasp.octree.build import octree_from_points
from tr_grasp.octree.frame import OctreeFrame
from tr_grasp.octree.layers import OctreeConv, OctreeDeconv, OctreePool
from tr_grasp.octree.operators import (
    octree_conv,
    octree_deconv,
    octree_join_children,
    octree_pool,
    octree_to_voxels,
)
from tr_grasp.octree.spec import OctreeSpec
from tr_grasp.octree.structure import NodeSet, Octree, OctreeLevel
from tr_grasp.octree.symmetry import augment, random_elements, turn_action, turn_frames, turn_proprio, turn_target

__all__ = [
    "NodeSet",
    "Octree",
    "OctreeConv",
    "OctreeDeconv",
    "OctreeFrame",
    "OctreeLevel",
    "OctreePool",
    "OctreeSpec",
    "augment",
    "octree_conv",
    "octree_deconv",
    "octree_from_points",
    "octree_join_children",
    "octree_pool",
    "octree_to_voxels",
    "random_elements",
    "turn_action",
    "turn_frames",
    "turn_proprio",
    "turn_target",
]
