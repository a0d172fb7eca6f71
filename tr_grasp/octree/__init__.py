"""Octrees: points to stored frames, batches of frames to merged octrees, and the operators on them."""

from tr_grasp.octree.build import (
    LeafOverflowWarning,
    OctreeBuild,
    count_octree_from_points,
    octree_from_points,
    octrees_from_clouds,
)
from tr_grasp.octree.dense import DenseLevel, DenseOctree
from tr_grasp.octree.frame import OctreeFrame
from tr_grasp.octree.layers import OctreeConv, OctreeDeconv, OctreePool
from tr_grasp.octree.operators import (
    octree_channel_pool,
    octree_conv,
    octree_deconv,
    octree_global_pool,
    octree_join_children,
    octree_pool,
    octree_to_voxels,
    octree_upsample,
)
from tr_grasp.octree.sparse import SparseLevel, SparseOctree
from tr_grasp.octree.spec import OctreeSpec
from tr_grasp.octree.structure import Backend, NodeSet, Octree, OctreeLevel
from tr_grasp.octree.symmetry import augment, random_elements, turn_action, turn_frames, turn_proprio, turn_target

__all__ = [
    "Backend",
    "DenseLevel",
    "DenseOctree",
    "LeafOverflowWarning",
    "NodeSet",
    "Octree",
    "OctreeBuild",
    "OctreeConv",
    "OctreeDeconv",
    "OctreeFrame",
    "OctreeLevel",
    "OctreePool",
    "OctreeSpec",
    "SparseLevel",
    "SparseOctree",
    "augment",
    "count_octree_from_points",
    "octree_channel_pool",
    "octree_conv",
    "octree_deconv",
    "octree_from_points",
    "octree_global_pool",
    "octree_join_children",
    "octree_pool",
    "octree_to_voxels",
    "octree_upsample",
    "octrees_from_clouds",
    "random_elements",
    "turn_action",
    "turn_frames",
    "turn_proprio",
    "turn_target",
]
