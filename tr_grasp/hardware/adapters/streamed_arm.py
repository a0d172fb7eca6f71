"""Arms that are told at a fixed rate where to be next: what is the same for all of them."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from tr_grasp.errors import HardwareError
from tr_grasp.hardware.adapters.shared_follower import SharedFollower
from tr_grasp.hardware.command import Command, Ending
from tr_grasp.hardware.readings import ArmState
from tr_grasp.hardware.real_world import Beats
from tr_grasp.motion import JointState, MotionLimits, Trajectory

STALE_S = 0.15
"""An arm whose state is older is not moved on."""
LOST_S = 1.0
"""One that has been silent for so long is not connected."""
STILL_RAD_S = 0.02


class ArmLink(Protocol):
    """An arm in its own language; only the thread of its beats and :meth:`close` use it after it was opened."""

    @property
    def rate_hz(self) -> float:
        """How often it wants to be told."""
        ...

    def read(self) -> ArmState:
        """The newest state.

        Raises:
            HardwareError: Not connected.
        """
        ...

    def ready(self) -> None:
        """Make it take set-points, after it was opened or halted.

        Raises:
            HardwareError: It does not.
        """
        ...

    def send(self, told: JointState, following: JointState) -> None:
        """Where to be now and one period later.

        Raises:
            HardwareError: It does not take it.
        """
        ...

    def halt(self) -> None:
        """Stop at once and take no set-points; never fails, for it is called when something has."""
        ...

    def close(self) -> None:
        """Let go of it."""
        ...


class StreamedArm:
    """An arm behind a link.

    When its state is old, it reports a fault, or a set-point cannot be sent, the arm is halted and its commands end as
    ``FAULT``. When that is over it stands still, and the next command makes it ready again.

    Args:
        name: Of the robot.
        limits: Of the arm.
        link: To it.
        clock: Of its world.

    Raises:
        HardwareError: It cannot be asked, or does not take commands.
    """

    def __init__(self, name: str, limits: MotionLimits, link: ArmLink, clock: Beats) -> None:
        self.name, self.limits = name, limits
        self._link, self._clock, self._period_s = link, clock, 1.0 / link.rate_hz
        self._seen, self._trouble, self._lost, self._halted = link.read(), "", "", False
        self._follower = SharedFollower(limits, self._seen.q_rad, lambda: clock.now_s)
        if self._seen.fault:
            raise HardwareError(f"the arm {name!r} reports a fault: {self._seen.fault}.")
        link.ready()
        self._end_beats = clock.every(self._period_s, self._beat)

    @property
    def setpoint_timeout_s(self) -> float:
        """For how long a set-point holds."""
        return self._follower.setpoint_timeout_s

    def state(self) -> ArmState:
        """The newest measurement."""
        if self._lost:
            raise HardwareError(self._lost)
        return self._seen

    def commanded(self, at_s: float | None = None) -> JointState:
        """What the joints are to do."""
        return self._follower.commanded(at_s)

    def move(self, trajectory: Trajectory, *, at_s: float | None = None) -> Command:
        """Follow a trajectory."""
        with self._follower.lock:
            reason = self._woken()
            return Command.ended(Ending.FAULT, reason) if reason else self._follower.move(trajectory, at_s)

    def servo(self, q_rad: ArrayLike, dq_rad_s: ArrayLike) -> Command:
        """Be here now."""
        with self._follower.lock:
            reason = self._woken()
            return Command.ended(Ending.FAULT, reason) if reason else self._follower.servo(q_rad, dq_rad_s)

    def stop(self) -> None:
        """Come to rest."""
        self._follower.stop()

    def close(self) -> None:
        """Halt it and let go of it; what goes on ends as stopped."""
        self._end_beats()
        self._follower.stop(detail="the station was closed")
        self._link.halt()
        self._link.close()

    def _woken(self) -> str:
        """Why it cannot move; empty once it can."""
        if self._trouble:
            return self._trouble
        if self._halted:
            try:
                self._link.ready()
            except HardwareError as error:
                return str(error)
            self._halted = False
        return ""

    def _beat(self) -> None:
        with self._follower.lock:
            trouble = self._look() or self._go_on()
            if trouble and not self._trouble:
                self._follower.stop(Ending.FAULT, trouble)
                self._link.halt()
                self._halted = True
            self._trouble = trouble

    def _look(self) -> str:
        """Read the state; why it cannot be relied upon."""
        try:
            seen = self._link.read()
        except HardwareError as error:
            self._lost = str(error)
            return self._lost
        age = self._clock.now_s - seen.stamp_s
        self._seen = seen
        self._lost = (
            f"the arm {self.name!r} is not connected: nothing has come for {age:.2g} s." if age > LOST_S else ""
        )
        return self._lost or seen.fault or (f"its state is {age:.2g} s old" if age > STALE_S else "")

    def _go_on(self) -> str:
        """Send the next set-point; why that was not possible."""
        if self._halted:
            self._settle()
            return ""
        told = self._follower.update()
        try:
            self._link.send(told, self._follower.commanded(self._clock.now_s + self._period_s))
        except HardwareError as error:
            return str(error)
        return ""

    def _settle(self) -> None:
        """Let what is commanded be where the arm was left, until it has come to rest there."""
        away = np.abs(self._seen.q_rad - self._follower.commanded().q).max()
        if np.abs(self._seen.dq_rad_s).max() > STILL_RAD_S or away > STILL_RAD_S:
            self._follower.rest_at(self._seen.q_rad)
