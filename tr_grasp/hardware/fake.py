"""A station without hardware or physics: joints go where they are told, and devices fail on cue.

Its time is virtual and everything is deterministic, so that what is built on the protocols is tested in milliseconds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from tr_grasp.errors import HardwareError
from tr_grasp.hardware.command import Command, Ending
from tr_grasp.hardware.fake_gripper import FakeGripper
from tr_grasp.hardware.faults import Fault, FaultScript
from tr_grasp.hardware.follower import Follower
from tr_grasp.hardware.protocols import Station
from tr_grasp.hardware.readings import ArmState, Intrinsics, RGBDImage
from tr_grasp.hardware.virtual_world import TICK_S, ScriptedObject, VirtualWorld
from tr_grasp.motion import JointState, MotionLimits, Trajectory
from tr_grasp.robots.spec import RobotSpec
from tr_grasp.sensing import PinholeCamera

PLANE_RGB = (122, 112, 102)


class FakeArm:
    """Joints that follow their commands exactly, or as a first-order lag.

    Attributes:
        external_effort_nm: (dof,) torque that somebody applies; it is only reported.
    """

    def __init__(self, spec: RobotSpec, world: VirtualWorld, faults: FaultScript, lag_s: float) -> None:
        self.name, self.limits = spec.name, MotionLimits.of(spec)
        self.external_effort_nm = np.zeros(self.limits.dof)
        self._clock, self._faults, self._lag_s = (lambda: world.now_s), faults, lag_s
        self._follower = Follower(self.limits, spec.home_q_rad, self._clock)
        self._q = np.array(spec.home_q_rad, float)
        self._dq = np.zeros_like(self._q)
        self._seen = self._measure()
        world.on_tick(self._tick)

    @property
    def setpoint_timeout_s(self) -> float:
        """For how long a set-point holds."""
        return self._follower.setpoint_timeout_s

    def state(self) -> ArmState:
        """The newest measurement."""
        if self._faults.holds("disconnected"):
            raise HardwareError(f"the arm {self.name!r} is not connected.")
        return self._seen

    def commanded(self, at_s: float | None = None) -> JointState:
        """What the joints are to do."""
        return self._follower.commanded(at_s)

    def move(self, trajectory: Trajectory, *, at_s: float | None = None) -> Command:
        """Follow a trajectory."""
        reason = self._faults.reason
        return Command.ended(Ending.FAULT, reason) if reason else self._follower.move(trajectory, at_s)

    def servo(self, q_rad: ArrayLike, dq_rad_s: ArrayLike) -> Command:
        """Be here now."""
        reason = self._faults.reason
        return Command.ended(Ending.FAULT, reason) if reason else self._follower.servo(q_rad, dq_rad_s)

    def stop(self) -> None:
        """Come to rest."""
        self._follower.stop()

    def _measure(self) -> ArmState:
        stamp, fault = self._faults.stamp_s, self._faults.reason
        return ArmState(stamp, self._q.copy(), self._dq.copy(), self.external_effort_nm.copy(), fault)

    def _tick(self, dt_s: float) -> None:
        if reason := self._faults.reason:
            self._follower.stop(Ending.FAULT, reason)
        target = self._follower.update()
        share = 1.0 if self._lag_s == 0 else 1 - np.exp(-dt_s / self._lag_s)
        q = self._q + share * (target.q - self._q)
        self._dq = target.dq if self._lag_s == 0 else (q - self._q) / dt_s
        self._q = q
        if not self._faults.holds("stale"):
            self._seen = self._measure()


class FakeCamera:
    """Sees the plane z = 0 of the base frame and nothing else."""

    def __init__(self, camera: PinholeCamera, world: VirtualWorld, faults: FaultScript) -> None:
        self.camera, self.frame = camera, "camera_optical_frame"
        self._world, self._faults = world, faults

    def capture(self) -> RGBDImage:
        """The newest picture."""
        if self._faults.holds("disconnected"):
            raise HardwareError("the camera is not connected.")
        camera = self.camera
        rays = camera.rays_base.reshape(camera.height_px, camera.width_px, 6)
        with np.errstate(divide="ignore"):
            depth = -rays[..., 2] / rays[..., 5]
        depth = np.where((depth > 0) & np.isfinite(depth), depth, np.nan).astype(np.float32)
        rgb = np.where(np.isnan(depth)[..., None], 0, np.array(PLANE_RGB)).astype(np.uint8)
        return RGBDImage(self._faults.stamp_s, self.frame, rgb, depth, intrinsics_of(camera))


def intrinsics_of(camera: PinholeCamera) -> Intrinsics:
    """Of a camera with its principal point in the middle of the picture."""
    middle = (camera.width_px - 1) / 2, (camera.height_px - 1) / 2
    return Intrinsics(camera.width_px, camera.height_px, camera.focal_px, camera.focal_px, *middle)


@dataclass(frozen=True)
class KinematicFake(Station):
    """A station that fakes everything; made by :meth:`of`."""

    arm: FakeArm
    gripper: FakeGripper
    world: VirtualWorld
    camera: FakeCamera  # pyright: ignore[reportGeneralTypeIssues]  # `of` always gives one

    @classmethod
    def of(
        cls,
        spec: RobotSpec,
        *,
        objects: Sequence[ScriptedObject] = (),
        faults: Sequence[Fault] = (),
        lag_s: float = 0.0,
        blocked_at_m: float | None = None,
        camera: PinholeCamera | None = None,
        tick_s: float = TICK_S,
    ) -> KinematicFake:
        """A robot at home, with open fingers.

        Args:
            spec: The robot.
            objects: What moves around it.
            faults: What goes wrong, and when.
            lag_s: Time constant with which joints follow; 0 for exactly.
            blocked_at_m: Width of an object between the fingers.
            camera: Looks down at the table from a metre, if not given.
            tick_s: Time between two ticks.
        """
        world = VirtualWorld(objects, tick_s)
        script = FaultScript(faults, lambda: world.now_s)
        # Not quite from above: a camera that looks along "up" has no picture.
        camera = camera or PinholeCamera.looking_at((0.5, -0.01, 1.0), (0.5, 0.0, 0.0), 0.8, 64)
        arm = FakeArm(spec, world, script, lag_s)
        gripper = FakeGripper(spec.gripper, world.on_tick, script, blocked_at_m)
        return cls(arm=arm, gripper=gripper, world=world, camera=FakeCamera(camera, world, script))
