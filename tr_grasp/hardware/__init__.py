"""Arms, grippers, cameras and the world around them, simulated or real: one set of protocols, a fake, and a guard."""

from tr_grasp.hardware.command import Command, Ending, Result
from tr_grasp.hardware.fake import KinematicFake, intrinsics_of
from tr_grasp.hardware.faults import Fault
from tr_grasp.hardware.follower import Follower
from tr_grasp.hardware.guard import Guard
from tr_grasp.hardware.guard_cfg import GuardCfg
from tr_grasp.hardware.pose_stream import PoseStream, PoseStreamCfg
from tr_grasp.hardware.protocols import Arm, Gripper, RGBDCamera, Station, World
from tr_grasp.hardware.readings import ArmState, GripperState, Intrinsics, PoseReading, RGBDImage
from tr_grasp.hardware.virtual_world import ScriptedObject
from tr_grasp.hardware.waiting import finish, thinking

__all__ = [
    "Arm",
    "ArmState",
    "Command",
    "Ending",
    "Fault",
    "Follower",
    "Gripper",
    "GripperState",
    "Guard",
    "GuardCfg",
    "Intrinsics",
    "KinematicFake",
    "PoseReading",
    "PoseStream",
    "PoseStreamCfg",
    "RGBDCamera",
    "RGBDImage",
    "Result",
    "ScriptedObject",
    "Station",
    "World",
    "finish",
    "intrinsics_of",
    "thinking",
]
