"""What an arm, a gripper, a camera and the world around them can do, whoever makes them.

Metres, radians, newtons, seconds. All times are those of one clock, the world's: simulated or real, it goes on while
somebody calls :meth:`World.wait`, and all readings carry its stamps. A command returns at once with a handle; commands
that break a rule end as ``REFUSED`` with the reason and move nothing; what no device could make sense of (NaN, another
number of joints) raises :class:`~tr_grasp.errors.MotionError`; a device that cannot be asked raises
:class:`~tr_grasp.errors.HardwareError` when its state is read, and ends commands as ``FAULT``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from numpy.typing import ArrayLike

from tr_grasp.hardware.command import Command
from tr_grasp.hardware.readings import ArmState, GripperState, PoseReading, RGBDImage
from tr_grasp.motion import JointState, MotionLimits, Trajectory


@runtime_checkable
class Arm(Protocol):
    """Joints that follow trajectories and streamed set-points."""

    @property
    def name(self) -> str:
        """Of the robot."""
        ...

    @property
    def limits(self) -> MotionLimits:
        """What the arm can do; faster or further commands are refused."""
        ...

    def state(self) -> ArmState:
        """The newest measurement. It may be old: see its stamp.

        Raises:
            HardwareError: The arm is not connected.
        """
        ...

    def commanded(self, at_s: float | None = None) -> JointState:
        """What the joints are to do at a time, now or later, if no other command is given: where to plan on from."""
        ...

    def move(self, trajectory: Trajectory, *, at_s: float | None = None) -> Command:
        """Follow a trajectory.

        Args:
            trajectory: It starts where the arm is commanded to be then, as fast as it is commanded to move.
            at_s: When it starts; what goes on now goes on until then. Now, if not given.

        Returns:
            A handle; ``REFUSED`` if the trajectory starts elsewhere, leaves the limits, or should have started earlier.

        Raises:
            MotionError: Another number of joints.
        """
        ...

    def servo(self, q_rad: ArrayLike, dq_rad_s: ArrayLike) -> Command:
        """Be here now with this speed, (dof,) each; takes over from any trajectory.

        Call it again and again: between two calls the arm goes on at the speed, and without another call within
        ``setpoint_timeout_s`` it comes to rest by itself. One handle stands for the whole stream.

        Returns:
            The stream's handle; ``REFUSED`` if the set-point is outside the limits or out of reach from here.

        Raises:
            MotionError: NaN or another number of joints.
        """
        ...

    @property
    def setpoint_timeout_s(self) -> float:
        """For how long a set-point holds."""
        ...

    def stop(self) -> None:
        """Come to rest as fast as the limits allow, whatever goes on; again and again, if you like."""
        ...


@runtime_checkable
class Gripper(Protocol):
    """Fingers that open and close together."""

    @property
    def opening_range_m(self) -> tuple[float, float]:
        """Smallest and largest distance between the pads."""
        ...

    @property
    def speed_range_mps(self) -> tuple[float, float]:
        """Slowest and fastest change of the opening."""
        ...

    @property
    def force_range_n(self) -> tuple[float, float]:
        """Weakest and strongest grip."""
        ...

    def state(self) -> GripperState:
        """The newest measurement.

        Raises:
            HardwareError: The gripper is not connected.
        """
        ...

    def move(self, opening_m: float, *, speed_mps: float | None = None, force_n: float | None = None) -> Command:
        """Open or close; speed and force are the gripper's usual ones, if not given.

        Returns:
            A handle that ends as ``DONE`` at the opening, or as ``HOLDING`` where an object stopped the fingers, which
            then go on pressing; ``REFUSED`` for a value outside the ranges.

        Raises:
            MotionError: NaN.
        """
        ...

    def stop(self) -> None:
        """Stay as it is; a grip is kept. Again and again, if you like."""
        ...


@runtime_checkable
class RGBDCamera(Protocol):
    """Takes colour pictures with depth."""

    @property
    def frame(self) -> str:
        """Name of its optical frame."""
        ...

    def capture(self) -> RGBDImage:
        """The newest picture.

        Raises:
            HardwareError: There is none.
        """
        ...


@runtime_checkable
class World(Protocol):
    """Time, and where things are seen to be."""

    @property
    def now_s(self) -> float:
        """The clock."""
        ...

    def wait(self, duration_s: float) -> None:
        """Let time pass: a simulation is stepped, a real world slept through.

        Raises:
            MotionError: A negative duration, or NaN.
        """
        ...

    def charge(self, duration_s: float) -> None:
        """Account for time spent thinking: a simulation is stepped; in a real world it has passed already.

        Raises:
            MotionError: A negative duration, or NaN.
        """
        ...

    @property
    def objects(self) -> tuple[str, ...]:
        """Names of what is tracked."""
        ...

    def poses(self, name: str, after_s: float = float("-inf")) -> tuple[PoseReading, ...]:
        """Readings that have arrived and are stamped later than a time, oldest first; none while the thing is lost.

        Raises:
            MotionError: Nothing of that name is tracked.
        """
        ...


@dataclass(frozen=True)
class Station:
    """Devices that work together; they share the clock of ``world``."""

    arm: Arm
    gripper: Gripper
    world: World
    camera: RGBDCamera | None = None

    def close(self) -> None:
        """Let the devices go, where there is anything to let go of."""
