"""A motion in time: joints that follow one cubic between any two knots."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from tr_grasp.errors import MotionError, StorageError
from tr_grasp.files import write_atomically
from tr_grasp.motion.arguments import Array, joint_rows, positive
from tr_grasp.motion.limits import MotionLimits

SEAM_RAD, SEAM_RAD_S = 1e-3, 1e-2
"""How far two trajectories may be apart in position and speed where one takes over from the other."""


@dataclass(frozen=True, eq=False)
class JointState:
    """Where joints are and how they move: ``(*batch, dof)`` each [rad, rad/s, rad/s²]."""

    q: Array
    dq: Array
    ddq: Array

    @classmethod
    def at_rest(cls, q: ArrayLike) -> JointState:
        """Joints that stand still."""
        q = np.asarray(q, float)
        return cls(q, np.zeros_like(q), np.zeros_like(q))


@dataclass(frozen=True)
class Violation:
    """A limit that a trajectory exceeds: the joint, what of it, its largest value, the limit."""

    joint: int
    quantity: str
    value: float
    limit: float

    def __str__(self) -> str:
        return f"joint {self.joint} reaches {self.quantity} {self.value:.4g} where {self.limit:.4g} is allowed"


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Joint positions over time, from 0 s on.

    Between knots each joint follows the cubic that its positions and speeds there define, so acceleration is linear and
    jerk constant: the extremes of a piece are known exactly, and limits are checked without sampling.

    Attributes:
        times_s: (n,) knots, ascending from 0; n ≥ 2.
        q_rad: (n, dof) positions at the knots.
        dq_rad_s: (n, dof) speeds at the knots.

    Raises:
        MotionError: Shapes that do not fit, NaN, or times that do not ascend from 0.
    """

    times_s: Array
    q_rad: Array
    dq_rad_s: Array

    def __post_init__(self) -> None:
        q = np.asarray(self.q_rad, float)
        dof = q.shape[-1] if q.ndim == 2 else 0
        times = np.asarray(self.times_s, float)
        object.__setattr__(self, "times_s", times)
        object.__setattr__(self, "q_rad", joint_rows("trajectory.q_rad", q, dof))
        object.__setattr__(self, "dq_rad_s", joint_rows("trajectory.dq_rad_s", self.dq_rad_s, dof))
        if len(times) < 2 or len(times) != len(self.q_rad) or self.q_rad.shape != self.dq_rad_s.shape:
            raise MotionError(
                f"a trajectory needs two or more knots with times, positions and speeds, got {times.shape}, "
                f"{self.q_rad.shape} and {self.dq_rad_s.shape}."
            )
        if times[0] != 0 or not (np.diff(times) > 0).all():
            raise MotionError("trajectory.times_s must ascend from 0, without repeats or NaN.")

    @classmethod
    def resting(cls, q: ArrayLike, duration_s: float = 1e-3) -> Trajectory:
        """Stand still for a while."""
        rows = np.stack([np.asarray(q, float)] * 2)
        return cls(np.array([0.0, positive("duration_s", duration_s)]), rows, np.zeros_like(rows))

    @property
    def dof(self) -> int:
        """Number of joints."""
        return self.q_rad.shape[1]

    @property
    def duration_s(self) -> float:
        """Time of the last knot."""
        return float(self.times_s[-1])

    @property
    def start(self) -> JointState:
        """State at 0 s."""
        return self.sample(0.0)

    @property
    def end(self) -> JointState:
        """Position and speed of the last knot; acceleration as it arrives."""
        a0, jerk = self._pieces
        return JointState(self.q_rad[-1], self.dq_rad_s[-1], a0[-1] + jerk[-1] * (self.times_s[-1] - self.times_s[-2]))

    def sample(self, times_s: ArrayLike) -> JointState:
        """States at times (*batch,): fields (*batch, dof). Before the start and after the end the arm stands there."""
        times = np.asarray(times_s, float)
        if times.ndim == 0:
            return self._sample_once(float(times))
        clipped = np.clip(times, 0.0, self.duration_s)
        piece = np.clip(np.searchsorted(self.times_s, clipped, side="right") - 1, 0, len(self.times_s) - 2)
        tau = (clipped - self.times_s[piece])[..., None]
        a0, jerk = (values[piece] for values in self._pieces)
        q0, v0 = self.q_rad[piece], self.dq_rad_s[piece]
        moving = ((times >= 0) & (times <= self.duration_s))[..., None]
        return JointState(
            q0 + tau * (v0 + tau * (a0 / 2 + tau * jerk / 6)),
            moving * (v0 + tau * (a0 + tau * jerk / 2)),
            moving * (a0 + tau * jerk),
        )

    def _sample_once(self, time_s: float) -> JointState:
        """As :meth:`sample` at one time, several times faster: drives ask for it at every step of the physics."""
        tau = min(max(time_s, 0.0), self.duration_s)
        piece = min(max(int(np.searchsorted(self.times_s, tau, side="right")) - 1, 0), len(self.times_s) - 2)
        tau -= float(self.times_s[piece])
        a0, jerk = (values[piece] for values in self._pieces)
        q0, v0 = self.q_rad[piece], self.dq_rad_s[piece]
        q = q0 + tau * (v0 + tau * (a0 / 2 + tau * jerk / 6))
        if not 0 <= time_s <= self.duration_s:
            return JointState(q, np.zeros_like(q), np.zeros_like(q))
        return JointState(q, v0 + tau * (a0 + tau * jerk / 2), a0 + tau * jerk)

    def every(self, period_s: float) -> tuple[Array, JointState]:
        """Times (m,) at a fixed period, the end included, and the states there."""
        steps = int(np.floor(self.duration_s / positive("period_s", period_s) + 1e-9))
        times = np.append(np.arange(steps + 1) * period_s, self.duration_s)
        times = np.unique(np.minimum(times, self.duration_s))
        return times, self.sample(times)

    def peaks(self) -> dict[str, Array]:
        """Exact extremes (dof,): ``lower``, ``upper`` position, sizes of ``velocity``, ``acceleration``, ``jerk``."""
        h = np.diff(self.times_s)[:, None]
        a0, jerk = self._pieces
        turning = _roots_of_speed(self.dq_rad_s[:-1], a0, jerk, h)
        positions = [self.q_rad]
        positions += [self.q_rad[:-1] + t * (self.dq_rad_s[:-1] + t * (a0 / 2 + t * jerk / 6)) for t in turning]
        t = np.clip(np.divide(-a0, jerk, out=np.zeros_like(a0), where=jerk != 0), 0.0, h)
        speeds = [self.dq_rad_s, self.dq_rad_s[:-1] + t * (a0 + t * jerk / 2)]
        return {
            "lower": np.concatenate(positions).min(0),
            "upper": np.concatenate(positions).max(0),
            "velocity": np.abs(np.concatenate(speeds)).max(0),
            "acceleration": np.abs(np.concatenate([a0, a0 + h * jerk])).max(0),
            "jerk": np.abs(jerk).max(0),
        }

    def violations(self, limits: MotionLimits, *, margin: float = 1e-3, with_jerk: bool = False) -> list[Violation]:
        """Every limit that is exceeded, anywhere and not only at the knots.

        Args:
            limits: Of the same joints.
            margin: Part of a limit (for positions: rad) that counts as rounding.
            with_jerk: Also check jerk; time-optimal motion switches acceleration at once, Ruckig's does not.

        Raises:
            MotionError: The limits are for another number of joints.
        """
        if limits.dof != self.dof:
            raise MotionError(f"limits must be for the {self.dof} joints of the trajectory, got {limits.dof}.")
        peaks = self.peaks()
        checks = [
            ("velocity", limits.velocity_rad_s, 1 + margin),
            ("acceleration", limits.acceleration_rad_s2, 1 + margin),
            *([("jerk", limits.jerk_rad_s3, 1 + margin)] if with_jerk else []),
        ]
        found = [
            Violation(int(i), name, float(peaks[name][i]), float(limit[i]))
            for name, limit, allowance in checks
            for i in np.flatnonzero(peaks[name] > limit * allowance)
        ]
        low = np.flatnonzero(peaks["lower"] < limits.lower_rad - margin)
        high = np.flatnonzero(peaks["upper"] > limits.upper_rad + margin)
        found += [Violation(int(i), "position", float(peaks["lower"][i]), float(limits.lower_rad[i])) for i in low]
        found += [Violation(int(i), "position", float(peaks["upper"][i]), float(limits.upper_rad[i])) for i in high]
        return found

    def cut(self, from_s: float) -> Trajectory:
        """The rest from a time on, which becomes its 0 s.

        Raises:
            MotionError: The time is not before the end.
        """
        if not 0 <= from_s < self.duration_s:
            raise MotionError(f"from_s must be in [0, {self.duration_s:.4g}) s, got {from_s}.")
        later = self.times_s > from_s + 1e-9
        now = self.sample(from_s)
        return Trajectory(
            np.append(0.0, self.times_s[later] - from_s),
            np.vstack([now.q, self.q_rad[later]]),
            np.vstack([now.dq, self.dq_rad_s[later]]),
        )

    def splice(self, other: Trajectory, at_s: float) -> Trajectory:
        """This trajectory until a time, then the other one.

        Raises:
            MotionError: The other one has other joints, or does not start where and as fast as this one is then.
        """
        if other.dof != self.dof:
            raise MotionError(f"both trajectories must have {self.dof} joints, got {other.dof}.")
        if not 0 < at_s <= self.duration_s:
            raise MotionError(f"at_s must be in (0, {self.duration_s:.4g}] s, got {at_s}.")
        now = self.sample(at_s)
        gap, speed_gap = np.abs(now.q - other.q_rad[0]).max(), np.abs(now.dq - other.dq_rad_s[0]).max()
        if gap > SEAM_RAD or speed_gap > SEAM_RAD_S:
            raise MotionError(
                f"the other trajectory must start as this one is at {at_s:.4g} s: it is {gap:.4g} rad and "
                f"{speed_gap:.4g} rad/s away; {SEAM_RAD:g} rad and {SEAM_RAD_S:g} rad/s are allowed."
            )
        earlier = self.times_s < at_s - 1e-9
        return Trajectory(
            np.concatenate([self.times_s[earlier], at_s + other.times_s]),
            np.vstack([self.q_rad[earlier], other.q_rad]),
            np.vstack([self.dq_rad_s[earlier], other.dq_rad_s]),
        )

    def slower(self, factor: float) -> Trajectory:
        """The same path in ``factor`` times the time: speeds fall by the factor, accelerations by its square."""
        factor = positive("factor", factor)
        return Trajectory(self.times_s * factor, self.q_rad, self.dq_rad_s / factor)

    def save(self, path: str | Path, period_s: float | None = None) -> Path:
        """Write knots, or samples at a period, as the ending says: ``.json`` (can be loaded) or ``.csv`` (a table).

        Raises:
            MotionError: Another ending.
            StorageError: It could not be written.
        """
        path = Path(path)
        times, state = (self.times_s, None) if period_s is None else self.every(period_s)
        state = state or self.sample(times)
        if path.suffix == ".json":
            columns = {"times_s": times, "q_rad": state.q, "dq_rad_s": state.dq}
            text = json.dumps({name: values.tolist() for name, values in columns.items()})
        elif path.suffix == ".csv":
            head = ["time_s", *(f"{name}{i}" for name in ("q", "dq", "ddq") for i in range(self.dof))]
            rows = np.column_stack([times, state.q, state.dq, state.ddq])
            text = "\n".join([",".join(head), *(",".join(f"{value:.9g}" for value in row) for row in rows)]) + "\n"
        else:
            raise MotionError(f"path must end in .json or .csv, got {str(path)!r}.")
        write_atomically(path, text)
        return path

    @classmethod
    def load(cls, path: str | Path) -> Trajectory:
        """Read a ``.json`` that :meth:`save` wrote.

        Raises:
            StorageError: The file cannot be read, or holds something else.
            MotionError: It holds a trajectory that is not one.
        """
        try:
            content = json.loads(Path(path).read_text(encoding="utf-8"))
            return cls(*(np.array(content[name], float) for name in ("times_s", "q_rad", "dq_rad_s")))
        except (OSError, KeyError, TypeError, json.JSONDecodeError) as error:
            raise StorageError(f"'{path}' holds no trajectory: {error}.") from error

    @cached_property
    def _pieces(self) -> tuple[Array, Array]:
        """Acceleration at the start of each piece and its jerk, (n - 1, dof) each."""
        h = np.diff(self.times_s)[:, None]
        slope = np.diff(self.q_rad, axis=0) / h
        v0, v1 = self.dq_rad_s[:-1], self.dq_rad_s[1:]
        a0 = (6 * slope - 4 * v0 - 2 * v1) / h
        return a0, 6 * (v0 + v1 - 2 * slope) / h**2


def _roots_of_speed(v0: Array, a0: Array, jerk: Array, h: Array) -> list[Array]:
    """Times at which each piece's speed is zero, clipped into the piece: two arrays like ``v0``."""
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(np.maximum(a0**2 - 2 * jerk * v0, 0.0))
        # The stable form of the quadratic's roots: no difference of nearly equal numbers.
        lead = -(a0 + np.where(a0 >= 0, root, -root))
        times = [lead / jerk, 2 * v0 / lead]
    return [np.clip(np.nan_to_num(t, nan=0.0, posinf=0.0, neginf=0.0), 0.0, h) for t in times]
