"""Robots behind fakes of what their devices speak, ready for a verb, and how each of them can fail in motion."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import yaml

from tests.hardware.test_panda_adapter import hand, panda
from tests.hardware.transports import rtde, urcap
from tests.hardware.transports.realsense import RecordedRealSense
from tests.hardware.transports.stepped import SteppedWorld
from tr_grasp.calibration.interchange import CalibrationRecord
from tr_grasp.configs.io import dump_yaml
from tr_grasp.hardware import Station, intrinsics_of
from tr_grasp.hardware.adapters import robotiq
from tr_grasp.hardware.adapters.realsense import RealSense, RealSenseCfg
from tr_grasp.hardware.adapters.streamed_arm import StreamedArm
from tr_grasp.hardware.adapters.ur import UrCfg, UrLink
from tr_grasp.hardware.devices import DeviceStation
from tr_grasp.motion import Kinematics, MotionLimits
from tr_grasp.robots import robot_spec
from tr_grasp.sensing import Body, PinholeCamera, RaycastCamera, RaycastScene

EYE = PinholeCamera.looking_at((1.1, 0.0, 0.6), (0.5, 0.0, 0.05), 0.6, 64)
COUNT_M = 1e-4


@dataclass(frozen=True)
class Bench(DeviceStation):
    """Devices that close as real ones do, and their fake."""

    fake: object = None

    def close(self) -> None:
        """Let go of both."""
        self.gripper.close()
        self.arm.close()


def panda_bench(picture=None) -> Bench:
    """A Panda whose fingers find something 30 mm wide."""
    arm, robot, world = panda()
    gripper, device = hand(world)
    device.fingers.blocked_at = 0.03
    camera = None
    if picture is not None:
        cfg = RealSenseCfg(width_px=EYE.width_px, height_px=EYE.height_px)
        camera = RealSense(cfg, world, RecordedRealSense(picture, world))
    return Bench(arm, gripper, world, camera, robot)


def ur5_bench() -> Bench:
    """A UR5 whose 2F-85 finds something."""
    spec, world = robot_spec("ur5_robotiq_2f85"), SteppedWorld()
    box = rtde.Controller(world, spec.home_q_rad)
    link = UrLink(rtde.RTDEControlInterface(box), rtde.RTDEReceiveInterface(box), UrCfg("here"), world)
    fingers = urcap.Robotiq(world)
    fingers.fingers.blocked_at = 123
    gripper = robotiq.open_gripper(spec.gripper, robotiq.RobotiqCfg("127.0.0.1", fingers.port), world)
    return Bench(StreamedArm(spec.name, MotionLimits.of(spec), link, world), gripper, world, None, box)


def kinova_bench() -> Bench:
    """A j2s7s300 behind a rosbridge on the loopback, whose fingers find something."""
    from tests.hardware.test_kinova_adapter import Laboratory

    lab = Laboratory()
    lab.server.driver.fingers.blocked_at = 3400.0
    return Bench(lab.arm, lab.gripper, lab.world, None, lab)


BENCHES = {
    "panda": ("panda", panda_bench),
    "ur5": ("ur5_robotiq_2f85", ur5_bench),
    "j2s7s300": ("j2s7s300", kinova_bench),
}
"""By the name of the arm: the robot, and what makes its bench."""


def fail_in_motion(bench: Station, cause) -> None:
    """Let something happen as soon as the arm moves in earnest."""
    state = {"done": False}

    def listener(_):
        if not state["done"] and bench.world.now_s > 0.3 and np.abs(bench.arm.commanded().dq).max() > 0.1:
            state["done"] = True
            cause(bench.fake)

    bench.world.on_tick(listener)


def station_file(folder, robot: str):
    """A station around a robot's home: something 50 mm high under the hand is carried 8 cm aside. Takes seconds."""
    spec = robot_spec(robot)
    T = Kinematics(spec).pose(np.array(spec.home_q_rad))
    x, y, z = T[:3, 3] - [0.0, 0.0, 0.05]
    down = [1.0, 0.0, 0.0, 0.0]
    poses = {
        "grasp": {"position_m": [float(x), float(y), float(z)], "orientation_xyzw": down},
        "pre_grasp": {"like": "grasp", "back_off_m": 0.04},
        "post_grasp": {"like": "grasp", "lift_m": 0.04},
        "place": {"position_m": [float(x), float(y) + 0.08, float(z)], "orientation_xyzw": down},
        "post_place": {"like": "place", "back_off_m": 0.04},
    }
    ways = [("pre-grasp", "move", "pre_grasp"), ("grasp", "line", "grasp"), ("close", "close", None)]
    ways += [("post-grasp", "line", "post_grasp"), ("place", "move", "place"), ("open", "open", None)]
    ways += [("post-place", "line", "post_place"), ("home again", "move", "home")]
    stages = [{"name": name, "do": do} | ({"to": to} if to else {}) for name, do, to in ways]
    content = {
        "robot": robot,
        "pose_link": spec.tcp_link,
        "poses": poses,
        "stages": stages,
        "object": {"radius_m": 0.015, "height_m": 0.05, "foot_m": [float(x), float(y), float(z) - 0.025]},
    }
    path = folder / f"{robot}.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


def recorded_table(folder):
    """A recording of a table with a box on it, as :data:`EYE` sees them; and the calibration of that camera."""
    box = Body.uniform(*_box(0.5, 0.05, 0.03), (0.8, 0.2, 0.2))
    table = Body.uniform([[0, -1, 0], [2, -1, 0], [2, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]], (0.5,) * 3)
    shown = RaycastCamera(RaycastScene([], [table, box]), EYE).capture(np.zeros((0, 4, 4)))
    depth = np.where(np.isfinite(shown.depth), shown.depth / COUNT_M, 0).astype(np.uint16)
    k = intrinsics_of(EYE)
    told = [k.fx, k.fy, k.cx, k.cy]
    rgb = (255 * np.clip(shown.colour, 0, 1)).astype(np.uint8)
    np.savez(folder / "table.npz", rgb=rgb[None], depth=depth[None], scale=COUNT_M, intrinsics=told)
    rows = tuple(tuple(float(value) for value in row) for row in EYE.T_base_cam)
    record = replace(CalibrationRecord(), setup="eye_on_base", T_base_cam=rows)
    (folder / "camera.yaml").write_text(dump_yaml(record))
    return folder / "table.npz", folder / "camera.yaml"


def _box(x, y, half):
    import trimesh

    mesh = trimesh.creation.box((2 * half, 2 * half, 2 * half))
    return mesh.vertices + np.array([x, y, half]), mesh.faces
