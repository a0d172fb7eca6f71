"""Franka Emika Panda, read from the URDF that ManiSkill brings.

Accelerations and jerks: Franka Control Interface documentation, limits in joint space; gripper: Franka Hand datasheet.
"""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from tr_grasp.errors import ConfigError
from tr_grasp.robots.parts import FingerSpec, GripperSpec
from tr_grasp.robots.spec import RobotSpec
from tr_grasp.robots.tree import arm_between, with_dynamics
from tr_grasp.robots.urdf_reader import UrdfFile

ACCELERATIONS = (15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0)
JERKS = (7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0)
PAD_M, TIP_M = 0.0455, 0.0545
"""Middle and end of the rubber tips, along the finger."""
TCP_M = 0.1034 - 0.0584
"""The tcp in the frame of a finger, along it."""


def panda() -> RobotSpec:
    """ManiSkill's Panda (``panda_v2.urdf``).

    Raises:
        ConfigError: ManiSkill is not installed.
    """
    file = UrdfFile(_urdf_path(), mimic=True)  # the fingers mimic each other there; here the controller couples them
    arm = arm_between(file, "panda_link0", "panda_link8")
    joints = {joint.name: joint for joint in file.joints}
    fingers = tuple(
        FingerSpec(
            joints=(joints[f"panda_finger_joint{number}"],),
            closed=(0.0,),
            open=(0.04,),
            links=(f"panda_{side}finger",),
            pad_link=f"panda_{side}finger",
            pad_point_m=(0.0, 0.0, PAD_M),
            tip_point_m=(0.0, 0.0, TIP_M),
        )
        for number, side in ((1, "left"), (2, "right"))
    )
    return RobotSpec(
        name="panda",
        base_link="panda_link0",
        tcp_link="panda_hand_tcp",
        joints=tuple(with_dynamics(j, a, k) for j, a, k in zip(arm, ACCELERATIONS, JERKS, strict=True)),
        gripper=GripperSpec(
            fingers,
            openings_m=(0.0, 0.08),
            tips_m=(TIP_M - TCP_M, TIP_M - TCP_M),
            speed_mps=0.4,  # faster than the real hand's 0.1: what Task I's policies were trained with
            speed_range_mps=(0.01, 0.1),
            force_n=40.0,
            force_range_n=(3.0, 70.0),
            stiffness=1000.0,
        ),
        home_q_rad=(0.0, -0.025767, 0.0, -2.344287, 0.0, 2.31852, 0.785398),
        links=file.links,
        fixed_joints=tuple(joint for joint in file.joints if joint.kind == "fixed"),
        urdf_path=file.path,
    )


def _urdf_path() -> Path:
    # Looked for without importing ManiSkill, which takes seconds and loads the simulator.
    package = find_spec("mani_skill")
    if package is None or package.origin is None:
        raise ConfigError("the robot 'panda' comes with ManiSkill, which is not installed: pip install mani-skill.")
    return Path(package.origin).parent / "assets" / "robots" / "panda" / "panda_v2.urdf"
