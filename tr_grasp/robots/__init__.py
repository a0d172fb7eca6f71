"""Arms and their grippers: as data, as URDF, and as something to move."""

from tr_grasp.robots.chain import ChainKinematics, link_poses
from tr_grasp.robots.fingers import CoupledFingers
from tr_grasp.robots.parts import DhTable, FingerSpec, GripperSpec, JointSpec, LinkSpec, Shape
from tr_grasp.robots.spec import RobotSpec, robot_names, robot_spec
from tr_grasp.robots.urdf import urdf_text, write_urdf
from tr_grasp.robots.user import load_robot

__all__ = [
    "ChainKinematics",
    "CoupledFingers",
    "DhTable",
    "FingerSpec",
    "GripperSpec",
    "JointSpec",
    "LinkSpec",
    "RobotSpec",
    "Shape",
    "link_poses",
    "load_robot",
    "robot_names",
    "robot_spec",
    "urdf_text",
    "write_urdf",
]
