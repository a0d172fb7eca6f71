"""A follower that a caller and the thread of a device share."""

from __future__ import annotations

import threading
from collections.abc import Callable

from numpy.typing import ArrayLike

from tr_grasp.hardware.command import Command, Ending
from tr_grasp.hardware.follower import SETPOINT_TIMEOUT_S, Follower
from tr_grasp.motion import JointState, MotionLimits, Trajectory


class SharedFollower(Follower):
    """See :class:`~tr_grasp.hardware.follower.Follower`; one at a time.

    Attributes:
        lock: Held in every call; take it to make several calls at once.
    """

    def __init__(
        self,
        limits: MotionLimits,
        q_rad: ArrayLike,
        clock: Callable[[], float],
        setpoint_timeout_s: float = SETPOINT_TIMEOUT_S,
    ) -> None:
        self.lock = threading.RLock()
        super().__init__(limits, q_rad, clock, setpoint_timeout_s)

    def rest_at(self, q_rad: ArrayLike) -> None:
        """Forget everything and stand still."""
        with self.lock:
            super().rest_at(q_rad)

    def commanded(self, at_s: float | None = None) -> JointState:
        """What the joints are to do."""
        with self.lock:
            return super().commanded(at_s)

    def move(self, trajectory: Trajectory, at_s: float | None = None) -> Command:
        """Follow a trajectory."""
        with self.lock:
            return super().move(trajectory, at_s)

    def servo(self, q_rad: ArrayLike, dq_rad_s: ArrayLike) -> Command:
        """Be here now."""
        with self.lock:
            return super().servo(q_rad, dq_rad_s)

    def stop(self, ending: Ending = Ending.STOPPED, detail: str = "") -> None:
        """Brake."""
        with self.lock:
            super().stop(ending, detail)

    def update(self) -> JointState:
        """What is commanded now."""
        with self.lock:
            return super().update()

    def _cancel(self, command: Command) -> None:
        with self.lock:
            super()._cancel(command)
