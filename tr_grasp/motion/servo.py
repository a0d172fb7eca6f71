"""Follow a target that moves, tick by tick, with limited jerk (Ruckig's velocity interface)."""

from __future__ import annotations

import numpy as np
import ruckig
from numpy.typing import ArrayLike

from tr_grasp.errors import MotionError
from tr_grasp.motion.arguments import Array, joint_vector, positive
from tr_grasp.motion.limits import MotionLimits
from tr_grasp.motion.point_to_point import ruckig_input
from tr_grasp.motion.trajectory import JointState

BRAKING_SHARE = 0.4
"""Part of the acceleration limit that the approach to a target counts on; the rest covers the time jerk takes."""
LARGEST_GAIN = 8.0


class Servo:
    """Joint commands at a fixed rate that never exceed the limits of speed, acceleration and jerk.

    A tick costs tens of microseconds. All methods that move return the new commanded state. They are the only thing
    that moves: a call that raises leaves the state as it was.

    The speed asked of Ruckig is the target's own plus ``min(gain |error|, sqrt(2 · 0.4 · acceleration · |error|))``
    towards it. Ruckig's position interface would start anew every tick, and stay behind a moving target for ever.

    Args:
        limits: Of the joints.
        period_s: Time between two ticks.
        gain: Speed per error [1/s]. At more than about jerk / acceleration the arm swings around the target, so that,
            capped at 8, is the default.

    Raises:
        MotionError: A period or gain that is not positive.
    """

    def __init__(self, limits: MotionLimits, period_s: float = 1 / 240, gain: float | None = None) -> None:
        self.limits, self.period_s = limits, positive("period_s", period_s)
        fastest = float(np.min(limits.jerk_rad_s3 / limits.acceleration_rad_s2))
        self.gain = min(LARGEST_GAIN, fastest) if gain is None else positive("gain", gain)
        self._otg = ruckig.Ruckig(limits.dof, self.period_s)
        self._output = ruckig.OutputParameter(limits.dof)
        self._state: JointState | None = None

    @property
    def state(self) -> JointState:
        """What is commanded now.

        Raises:
            MotionError: :meth:`start` was not called.
        """
        if self._state is None:
            raise MotionError("the servo does not know where the arm is; call start(q) first.")
        return self._state

    def start(self, q: ArrayLike, dq: ArrayLike | None = None, ddq: ArrayLike | None = None) -> JointState:
        """Take over an arm that is here and moves like this (at rest if not given).

        Raises:
            MotionError: NaN or another number of joints.
        """
        zeros = np.zeros(self.limits.dof)
        values = (q, zeros if dq is None else dq, zeros if ddq is None else ddq)
        self._state = JointState(
            *(
                joint_vector(name, value, self.limits.dof)
                for name, value in zip(("q", "dq", "ddq"), values, strict=True)
            )
        )
        return self._state

    def track(self, q_target: ArrayLike, dq_target: ArrayLike | None = None) -> JointState:
        """One tick after a target that is here now and moves at this speed (stands still if not given).

        A target outside the joint limits is followed to the limit. Faster ones than the arm are followed at its limit.

        Raises:
            MotionError: NaN or another number of joints.
        """
        limits, state = self.limits, self.state
        target = np.clip(joint_vector("q_target", q_target, limits.dof), limits.lower_rad, limits.upper_rad)
        feed = np.zeros(limits.dof) if dq_target is None else joint_vector("dq_target", dq_target, limits.dof)
        error = target - state.q
        speed = feed + np.sign(error) * self._braking(np.abs(error))
        # The fastest from which the arm still stops before a joint limit.
        room = np.maximum(state.q - limits.lower_rad, 0.0), np.maximum(limits.upper_rad - state.q, 0.0)
        return self._tick(np.clip(speed, -self._braking(room[0]), self._braking(room[1])))

    def move(self, dq: ArrayLike) -> JointState:
        """One tick towards a joint speed, which is clipped to what the limits allow here.

        Raises:
            MotionError: NaN or another number of joints.
        """
        limits, state = self.limits, self.state
        speed = joint_vector("dq", dq, limits.dof)
        room = np.maximum(state.q - limits.lower_rad, 0.0), np.maximum(limits.upper_rad - state.q, 0.0)
        return self._tick(np.clip(speed, -self._braking(room[0]), self._braking(room[1])))

    def reach(self, q_goal: ArrayLike, dq_goal: ArrayLike | None = None) -> JointState:
        """One tick of the fastest synchronised motion to a state (Ruckig's position interface).

        Raises:
            MotionError: NaN, another number of joints, or a goal outside the limits of position or speed.
        """
        limits = self.limits
        goal = joint_vector("q_goal", q_goal, limits.dof)
        speed = np.zeros(limits.dof) if dq_goal is None else joint_vector("dq_goal", dq_goal, limits.dof)
        if not limits.hold(goal) or (np.abs(speed) > limits.velocity_rad_s).any():
            raise MotionError(
                f"q_goal and dq_goal must be within the joint limits, got {goal.tolist()} and {speed.tolist()}."
            )
        request = self._request()
        request.target_position, request.target_velocity = goal.tolist(), speed.tolist()
        return self._advance(request)

    def stop(self) -> JointState:
        """One tick of stopping as fast as the limits allow; at rest, nothing moves any more."""
        return self._tick(np.zeros(self.limits.dof))

    @property
    def is_at_rest(self) -> bool:
        """No joint moves."""
        return bool(np.abs(self.state.dq).max() < 1e-9 and np.abs(self.state.ddq).max() < 1e-9)

    def _braking(self, distance: Array) -> Array:
        """Speed (dof,) from which the arm comes to rest within a distance, gently at the end."""
        braking = np.sqrt(2 * BRAKING_SHARE * self.limits.acceleration_rad_s2 * distance)
        return np.minimum(self.gain * distance, braking)

    def _tick(self, speed: Array) -> JointState:
        request = self._request()
        request.control_interface = ruckig.ControlInterface.Velocity
        request.synchronization = ruckig.Synchronization.No
        top = self.limits.velocity_rad_s * (1 - 1e-6)
        request.target_velocity = np.clip(speed, -top, top).tolist()
        return self._advance(request)

    def _request(self) -> ruckig.InputParameter:
        state, request = self.state, ruckig_input(self.limits)
        request.current_position, request.current_velocity = state.q.tolist(), state.dq.tolist()
        request.current_acceleration = state.ddq.tolist()
        return request

    def _advance(self, request: ruckig.InputParameter) -> JointState:
        # Ruckig Community sends intermediate waypoints to a web service; they are never given.
        assert not request.intermediate_positions
        try:
            result = self._otg.update(request, self._output)
        except ruckig.RuckigError as error:
            raise MotionError(
                f"the servo cannot move on from {self.state.q.tolist()}: {str(error).strip()}."
            ) from error
        if result not in (ruckig.Result.Working, ruckig.Result.Finished):
            raise MotionError(f"the servo cannot move on from {self.state.q.tolist()}: {result}.")
        new = self._output
        self._state = JointState(*(np.array(x) for x in (new.new_position, new.new_velocity, new.new_acceleration)))
        return self._state
