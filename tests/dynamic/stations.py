"""A kinematic station with an object on a scripted path, and the task that goes with it."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from tr_grasp.configs.dynamic import ChargesCfg
from tr_grasp.dynamic import DynamicTask, Phase
from tr_grasp.geometry import rotation_about_z
from tr_grasp.grasps import GraspSet, shipped_grasp_set
from tr_grasp.hardware import KinematicFake, PoseStreamCfg, ScriptedObject
from tr_grasp.motion import Kinematics, Obstacle, box
from tr_grasp.objects.conveyor import conveyor_object
from tr_grasp.objects.model import ObjectModel
from tr_grasp.robots import robot_spec

ROBOT = "ur5_robotiq_2f85"
OBJECT = "006_mustard_bottle"
CARRIER_M = (0.1, 0.1, 0.02)
Path = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


@cache
def parts(name: str = OBJECT) -> tuple[ObjectModel, GraspSet]:
    return conveyor_object(name).model, shipped_grasp_set(name)


@cache
def arm() -> Kinematics:
    return Kinematics(robot_spec(ROBOT))


def at(x: float, y: float, z: float) -> np.ndarray:
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


def line(start=(0.5, -0.3), velocity=(0.0, 0.03), yaw=0.7) -> Path:
    def path(times):
        xy = np.asarray(start) + np.asarray(times)[:, None] * np.asarray(velocity)
        return xy, np.full(len(xy), yaw)

    return path


def poses_on(path: Path, height_m: float):
    def motion(times):
        xy, yaw = path(np.asarray(times))
        T = np.tile(np.eye(4), (len(xy), 1, 1))
        T[:, :2, 3], T[:, 2, 3] = xy, height_m
        T[:, :3, :3] = [rotation_about_z(angle) for angle in yaw]
        return T

    return motion


class Carried:
    """A scripted object that goes with the hand once the fingers have closed around where it is."""

    def __init__(self, motion, kinematics: Kinematics) -> None:
        self.motion, self.kinematics = motion, kinematics
        self.station: KinematicFake | None = None
        self.taken: np.ndarray | None = None

    def __call__(self, times):
        if self.station is not None and self.taken is None and self.station.gripper.state().holding:
            self.taken = np.linalg.inv(self._tcp()) @ self.motion(np.asarray(times))[0]
        if self.taken is not None:
            return (self._tcp() @ self.taken)[None]
        return self.motion(np.asarray(times))

    def _tcp(self):
        return self.kinematics.pose(self.station.arm.state().q_rad)


def scene(
    path: Path,
    *,
    name: str = OBJECT,
    obstacles: tuple[Obstacle, ...] = (),
    width_m: float | None = 0.05,
    stream: PoseStreamCfg | None = None,
    path_end_s: float | None = None,
    holds: bool = True,
    told: list[Phase] | None = None,
):
    """A station and a task; the fingers meet something ``width_m`` wide, wherever they close."""
    model, grasps = parts(name)
    low = grasps.bounds_m[0, 2]
    height = CARRIER_M[2] - low
    motion = poses_on(path, height)
    carried = Carried(motion, arm())
    seen = carried if holds else motion
    robot = robot_spec(ROBOT)
    thing = ScriptedObject(name, seen, stream or PoseStreamCfg())
    station = KinematicFake.of(robot, objects=[thing], blocked_at_m=width_m)
    carried.station = station
    floor = box("floor", (2.0, 2.0, 0.1), at(0, 0, -0.055))
    task = DynamicTask(
        robot, name, model, grasps, (floor, *obstacles), CARRIER_M, at(0, 0, low - CARRIER_M[2] / 2), path_end_s,
        charges=ChargesCfg(mode="fixed", planning_s=0.02), tell=(told if told is not None else []).append,
    )  # fmt: skip
    return station, task
