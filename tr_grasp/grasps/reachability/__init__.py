"""How far tool poses are inside or outside of what an arm reaches."""

from tr_grasp.grasps.reachability.agreement import Agreement, agreement
from tr_grasp.grasps.reachability.build import ReachabilityCfg, build_reachability
from tr_grasp.grasps.reachability.field import ReachabilityField, reachability_field, robot_key, shipped_fields
from tr_grasp.grasps.reachability.labels import Domain, Labeller
from tr_grasp.grasps.reachability.slices import draw_slices

__all__ = [
    "Agreement",
    "Domain",
    "Labeller",
    "ReachabilityCfg",
    "ReachabilityField",
    "agreement",
    "build_reachability",
    "draw_slices",
    "reachability_field",
    "robot_key",
    "shipped_fields",
]
