"""Which joints are commanded when: trajectories one after the other, streams of set-points, brakes.

Backends differ in how they send joints to a drive, not in what they send: each asks a follower at its own rate.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from tr_grasp.errors import MotionError
from tr_grasp.hardware.command import Command, Ending
from tr_grasp.motion import JointState, MotionLimits, Trajectory
from tr_grasp.motion.arguments import Array, joint_vector, positive
from tr_grasp.motion.trajectory import SEAM_RAD, SEAM_RAD_S

SETPOINT_TIMEOUT_S = 0.1
MARGIN = 0.01
"""Part of a limit by which rounding and drift of clocks may exceed it."""
LATE_S = 1e-6
SHORTEST_BRAKE_S = 1e-6


@dataclass(eq=False)
class _Piece:
    """A trajectory on the world's clock; ``ends_s`` is when its command is carried out, or its set-points run out."""

    starts_s: float
    trajectory: Trajectory
    command: Command | None
    ends_s: float
    is_stream: bool = False

    def at(self, time_s: float) -> JointState:
        return self.trajectory.sample(max(0.0, time_s - self.starts_s))


class Follower:
    """Commanded joints over time. Set-points are short trajectories too: on at their speed, then to rest.

    Args:
        limits: Of the joints.
        q_rad: (dof,) where the arm rests.
        clock: Gives the world's time.
        setpoint_timeout_s: For how long a set-point holds before the arm brakes by itself.

    Raises:
        MotionError: NaN, another number of joints, or a time-out that is not positive.
    """

    def __init__(
        self,
        limits: MotionLimits,
        q_rad: ArrayLike,
        clock: Callable[[], float],
        setpoint_timeout_s: float = SETPOINT_TIMEOUT_S,
    ) -> None:
        self.limits, self._clock = limits, clock
        self.setpoint_timeout_s = positive("setpoint_timeout_s", setpoint_timeout_s)
        self.rest_at(q_rad)

    def rest_at(self, q_rad: ArrayLike) -> None:
        """Forget everything and stand still at joints (dof,)."""
        q = joint_vector("q_rad", q_rad, self.limits.dof)
        self._pieces = [_Piece(self._clock(), Trajectory.resting(q), None, self._clock())]

    def commanded(self, at_s: float | None = None) -> JointState:
        """What the joints are to do at a time, by the commands given so far."""
        at_s = self._clock() if at_s is None else at_s
        begun = [piece for piece in self._pieces if piece.starts_s <= at_s + LATE_S]
        return (begun or self._pieces[:1])[-1].at(at_s)

    def move(self, trajectory: Trajectory, at_s: float | None = None) -> Command:
        """See :meth:`tr_grasp.hardware.Arm.move`."""
        now = self._clock()
        starts = now if at_s is None else at_s
        if trajectory.dof != self.limits.dof:
            raise MotionError(f"the trajectory must have {self.limits.dof} joints, got {trajectory.dof}.")
        if reason := self._refuse(trajectory, starts, now):
            return Command.refused(reason)
        command = Command(self._cancel)
        end = trajectory.end
        whole = _joined(trajectory, self._brake(end.q, end.dq)) if end.dq.any() else trajectory
        self._take_over(_Piece(starts, whole, command, starts + trajectory.duration_s))
        return command

    def servo(self, q_rad: ArrayLike, dq_rad_s: ArrayLike) -> Command:
        """See :meth:`tr_grasp.hardware.Arm.servo`."""
        limits, now = self.limits, self._clock()
        q, dq = (joint_vector(name, x, limits.dof) for name, x in (("q_rad", q_rad), ("dq_rad_s", dq_rad_s)))
        self.advance()
        current = self._pieces[-1]
        if not limits.hold(q):
            return Command.refused(f"the set-point {np.round(q, 4).tolist()} is outside the joint limits")
        if (np.abs(dq) > limits.velocity_rad_s * (1 + MARGIN)).any():
            return Command.refused(f"the set-point's speed {np.round(dq, 4).tolist()} is above the limits")
        jump = np.abs(q - self.commanded(now).q)
        if (jump > limits.velocity_rad_s * self.setpoint_timeout_s).any():
            return Command.refused(f"the set-point is {jump.max():.3g} rad away, further than the arm comes in time")
        goes_on = current.is_stream and current.command is not None and not current.command.done
        command = current.command if goes_on and current.command is not None else Command(self._cancel)
        if goes_on:
            current.command = None  # the stream takes its handle along
        coast = _ramp(self.setpoint_timeout_s, q, q + dq * self.setpoint_timeout_s, dq, dq)
        whole = _joined(coast, self._brake(coast.q_rad[-1], dq)) if dq.any() else coast
        self._take_over(_Piece(now, whole, command, now + self.setpoint_timeout_s, is_stream=True))
        return command

    def stop(self, ending: Ending = Ending.STOPPED, detail: str = "") -> None:
        """Brake as fast as the limits allow, or go on braking."""
        now = self._clock()
        self.advance()
        braking = len(self._pieces) == 1 and self._pieces[0].command is None
        for piece in self._pieces:
            if piece.command is not None:
                piece.command.end(ending, detail)
        if not braking:
            state = self.commanded(now)
            self._pieces = [_Piece(now, self._brake(state.q, state.dq), None, now)]

    def update(self) -> JointState:
        """What is commanded now; commands that have ended by now are told so."""
        self.advance()
        return self.commanded()

    def advance(self) -> None:
        """Tell commands that have ended by now; :meth:`update` for whoever needs no joints."""
        now = self._clock()
        while len(self._pieces) > 1 and self._pieces[1].starts_s <= now + LATE_S:
            gone = self._pieces.pop(0)
            if gone.command is not None:
                done = not gone.is_stream and gone.ends_s <= self._pieces[0].starts_s + LATE_S
                gone.command.end(Ending.DONE if done else Ending.SUPERSEDED)
        piece = self._pieces[0]
        if piece.command is not None and not piece.is_stream:
            piece.command.progress = float(np.clip((now - piece.starts_s) / (piece.ends_s - piece.starts_s), 0.0, 1.0))
        if piece.command is not None and now + LATE_S >= piece.ends_s:
            if piece.is_stream:
                piece.command.end(Ending.STOPPED, f"no set-point for {self.setpoint_timeout_s:g} s")
            else:
                piece.command.end(Ending.DONE)
            piece.command = None

    @property
    def is_idle(self) -> bool:
        """No command is being carried out or waits."""
        return all(piece.command is None for piece in self._pieces)

    def _refuse(self, trajectory: Trajectory, starts_s: float, now_s: float) -> str:
        if starts_s < now_s - LATE_S:
            return f"the trajectory should have started {now_s - starts_s:.3g} s ago"
        expected, start = self.commanded(starts_s), trajectory.start
        gap, speed_gap = np.abs(start.q - expected.q).max(), np.abs(start.dq - expected.dq).max()
        if gap > SEAM_RAD or speed_gap > SEAM_RAD_S:
            return f"the trajectory starts {gap:.3g} rad and {speed_gap:.3g} rad/s from where the arm will be then"
        found = trajectory.violations(self.limits, margin=MARGIN)
        return str(found[0]) if found else ""

    def _take_over(self, new: _Piece) -> None:
        """From the start of ``new``, nothing else goes on."""
        for piece in self._pieces:
            if piece.starts_s >= new.starts_s - LATE_S and piece.command is not None:
                piece.command.end(Ending.SUPERSEDED)
        kept = [piece for piece in self._pieces if piece.starts_s < new.starts_s - LATE_S]
        self._pieces = [*kept, new]
        self.advance()

    def _cancel(self, command: Command) -> None:
        now = self._clock()
        waits = [piece for piece in self._pieces if piece.command is command and piece.starts_s > now + LATE_S]
        if waits:
            command.end(Ending.CANCELLED)
            self._pieces = [piece for piece in self._pieces if piece not in waits]
        else:
            command.end(Ending.CANCELLED)
            self.stop(Ending.CANCELLED, "the command before it was")

    def _brake(self, q: Array, dq: Array) -> Trajectory:
        """From a speed to rest on a straight line of the joints, the slowest to brake at its limit."""
        duration = float((np.abs(dq) / self.limits.acceleration_rad_s2).max())
        if duration < SHORTEST_BRAKE_S:
            return Trajectory.resting(q)
        return _ramp(duration, q, q + dq * duration / 2, dq, np.zeros_like(dq))


def _ramp(duration_s: float, q: Array, q_end: Array, dq: Array, dq_end: Array) -> Trajectory:
    return Trajectory(np.array([0.0, duration_s]), np.array([q, q_end]), np.array([dq, dq_end]))


def _joined(first: Trajectory, second: Trajectory) -> Trajectory:
    return Trajectory(
        np.append(first.times_s, first.duration_s + second.times_s[1:]),
        np.vstack([first.q_rad, second.q_rad[1:]]),
        np.vstack([first.dq_rad_s, second.dq_rad_s[1:]]),
    )
