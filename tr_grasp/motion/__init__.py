"""From where an arm is to where its tool should be: kinematics, collisions, planning, timing. No simulator, no ROS."""

from tr_grasp.motion.collision import Clearance, CollisionModel, Contact
from tr_grasp.motion.inverse_kinematics import IKCfg, IKSolutions, inverse_kinematics
from tr_grasp.motion.kinematics import Kinematics
from tr_grasp.motion.limits import MotionLimits
from tr_grasp.motion.obstacles import Obstacle, box, convex, point_cloud
from tr_grasp.motion.outcome import Outcome
from tr_grasp.motion.plan import Plan, PlannerCfg
from tr_grasp.motion.planner import Planner
from tr_grasp.motion.point_to_point import point_to_point
from tr_grasp.motion.servo import Servo
from tr_grasp.motion.time_optimal import time_optimal
from tr_grasp.motion.timing import Timing
from tr_grasp.motion.tool_target import tool_target
from tr_grasp.motion.trajectory import JointState, Trajectory, Violation

__all__ = [
    "Clearance",
    "CollisionModel",
    "Contact",
    "IKCfg",
    "IKSolutions",
    "JointState",
    "Kinematics",
    "MotionLimits",
    "Obstacle",
    "Outcome",
    "Plan",
    "Planner",
    "PlannerCfg",
    "Servo",
    "Timing",
    "Trajectory",
    "Violation",
    "box",
    "convex",
    "inverse_kinematics",
    "point_cloud",
    "point_to_point",
    "time_optimal",
    "tool_target",
]
